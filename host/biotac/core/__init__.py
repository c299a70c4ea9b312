"""The compiled firmware core under Python: results, a finger's tare machine, wrench maps, geometry."""
