"""Start the command line: `python -m maneuver_automaton`."""

from maneuver_automaton.cli import main

if __name__ == "__main__":
    main()
