"""What touch means: where, how sharp, which way, how many, by formula and by learning (seed 000).

A module an idea: paf, smooth, scores, roc, force, several, edge, grip, thermal; ``levenberg`` is the net and
``inputs`` what goes into it. All but paf, several, grip, thermal need the extra `features`.
"""
