"""A finger's wrench from its counts: models fitted to a force plate, and what they are worth held out.

``run`` reads a recording with its truth and refuses what cannot be calibrated from, ``joined`` joins a board's with a
reference's, ``guided`` makes both on a board; ``blocks`` cuts a run so that nothing leaks from test to training;
``features`` and ``models`` say what is linear in what; ``lag`` says how late counts come; ``crossvalidation`` chooses
and measures; ``report`` writes it down; ``contact`` is the force plate's own point of contact. Not to be mixed up
with ``biotac.keep``, which keeps the gains a board uses today.
"""
