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
dropped statement; or, with ``--rules``, a condition that is switched off or a constant of a module
that is moved far off. The map is made once for a tree of files: it says which blocks of the product
each test runs. The judge puts each mutant into a copy of the tree and runs the tests that reach
its block, cheapest first, until one fails. The user's files are never changed.

Without a map a mutant is judged by tests that are named: by hand (``--by``), or as those that
caught it before (``--again``). A test that is dear, or gone, is refused.

Drawn with seed 2026 and recorded here are sixty of the whole program (``drawn-2026.jsonl``,
``records-2026.jsonl``), ten rules of the judgement (``-judgement``) and ten of the verdict
(``-verdict``). ``make mutants-again`` judges them again and writes docs/mutants.md. Those of the
whole program that got away from the suite were given tests, or found to be equivalent, later.
"""
