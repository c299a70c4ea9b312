"""Reference sensors that measure the load on a finger: their files, live streams and clocks.

A reference measures in its own axes about its own origin; a Mounting turns that into the force on the finger in
Lin's frame. Nothing here depends on models or boards.
"""
