EXPECTED: dict[tuple[str, str], str] = {}
QUICK: set[tuple[str, str]] = set()
