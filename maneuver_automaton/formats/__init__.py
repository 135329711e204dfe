"""Files other than scenarios, one format a file; plans are read and written when asked for.

Those who read a map have no use for the planner that `plan_json` knows.

Whatever reads or checks a file raises InvalidScenario where it cannot be used: one line with file,
place, value met, what would be right. Whatever writes one raises OSError where it cannot.
"""
