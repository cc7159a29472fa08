"""Experiments that would separate the causes which readings leave open."""
