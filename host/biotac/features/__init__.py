"""Features of a touch: its place, sharpness, direction and number of contacts, by formula and by learning (seed 000).

Each module has one idea: paf, smooth, scores, roc, force, several, edge, grip, texture, thermal. ``levenberg`` is the
neural net and ``inputs`` prepares its inputs. The extra `features` is needed by scores, roc, force, edge, levenberg and
inputs, and by smooth.lowess() and texture.classifier().
"""
