"""Boards with rounds from another driver's messages: bags, topics of a robot, tables."""
