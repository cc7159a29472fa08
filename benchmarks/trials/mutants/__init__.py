"""Mutants: small faults made on purpose in the product, and the tests that notice them.

    python -m benchmarks.trials.mutants draw MUTANTS.jsonl [--count 60] [--seed 2026]
    python -m benchmarks.trials.mutants draw MUTANTS.jsonl --rules --scope studies/diagnosis/gain.py
    python -m benchmarks.trials.mutants map FOLDER [-- pytest options]
    python -m benchmarks.trials.mutants judge MUTANTS.jsonl --map FOLDER --keep RECORDS.jsonl
    python -m benchmarks.trials.mutants judge MUTANTS.jsonl --keep RECORDS.jsonl --again
    python -m benchmarks.trials.mutants judge MUTANTS.jsonl --keep RECORDS.jsonl --by 7=TEST
    python -m benchmarks.trials.mutants equivalent MUTANTS.jsonl --keep RECORDS.jsonl --only 7 …
    python -m benchmarks.trials.mutants table MUTANTS.jsonl --keep RECORDS.jsonl --titles …

A mutant is one changed place: an operator, a number, a condition, two swapped arguments, or a
dropped statement. The map is made once for a tree of files: it says which blocks of the product
each test runs. The judge puts each mutant into a copy of the tree and runs the tests that reach
its block, cheapest first, until one fails. The user's files are never changed.

``drawn-2026.jsonl`` are sixty of seed 2026; ``records-2026.jsonl`` says what became of the first 45
in the suite, with up to 100 or 300 s of processor time for each. Judging goes on from there.
"""
