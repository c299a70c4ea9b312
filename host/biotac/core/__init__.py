"""The compiled firmware core in Python: results, a finger's tare machine, wrench maps, geometry."""
