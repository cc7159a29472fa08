"""Claims of what the program computes right, each beside an independent reference.

``make verification`` runs them.
"""
