"""Newtons for a finger that nobody has calibrated: a map learnt from other fingers.

``training`` makes it of force-plate recordings; ``fewshot`` is what five presses on a scale, known ``weights`` or a
minute on a plate add, and ``presses`` how they come from a board; ``worth`` says what each leaves on a finger that the
map has not seen; ``keeping`` writes and reads its file, and holds the one that comes with the package. Recordings are
never part of it, coefficients and where they come from are.
"""
