"""Boards whose rounds are another driver's messages: bags, topics of a robot, tables."""
