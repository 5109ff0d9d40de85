# SPDX-License-Identifier: GPL-2.0-or-later
"""Options of all commands against the dictionary doc/options.md.

options.py DICTIONARY PROGRAM...: prints each difference and exits with 1; prints nothing and exits
with 0 if there is none. A row of the dictionary: | option | argument | meaning | commands |.
"""
import collections
import os
import re
import subprocess
import sys


def rows_of_help(program):
    """(option, letter, argument) of each option that --help lists."""
    text = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    options = text.split("\nOptions:\n", 1)[1].split("\n\n", 1)[0]
    for line in options.splitlines():
        found = re.match(r" {2}(?:-(\w), |    )--([a-z-]+)(?: (\S+))?", line)
        if found:
            yield "--" + found[2], found[1] or "", found[3] or ""


def main(dictionary, programs):
    used = collections.defaultdict(lambda: collections.defaultdict(set))
    names = {os.path.basename(p).split("-", 1)[1].replace("-", " ", 1) for p in programs}
    for program in programs:
        command = os.path.basename(program).split("-", 1)[1].replace("-", " ", 1)
        for option, letter, argument in rows_of_help(program):
            used[option][(letter, argument)].add(command)
    wrong, seen = [], set()
    for line in open(dictionary, encoding="utf-8"):
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        found = re.match(r"`(?:-(\w), )?(--[a-z-]+)`$", cells[0])
        if not found or len(cells) != 4:
            continue
        letter, option = found[1] or "", found[2]
        arguments = set(re.findall(r"`([^`]+)`", cells[1])) or {""}
        commands = names if cells[3] == "all" else set(cells[3].split(", "))
        if option in seen:
            wrong.append(f"{option}: two rows, and one meaning is allowed")
        seen.add(option)
        if not cells[2]:
            wrong.append(f"{option}: the row has no meaning")
        if option not in used:
            wrong.append(f"{option}: no command has it")
            continue
        have = set().union(*used[option].values())
        if have != commands:
            wrong.append(f"{option}: differs in {', '.join(sorted(have ^ commands))}")
        if {name for name, _ in used[option]} != {letter}:
            wrong.append(f"{option}: letters {sorted({name for name, _ in used[option]})}")
        if {name for _, name in used[option]} != arguments:
            wrong.append(f"{option}: arguments {sorted({name for _, name in used[option]})}")
    wrong += [f"{option}: not in the dictionary ({', '.join(sorted(set().union(*used[option].values())))})"
              for option in sorted(used) if option not in seen]
    letters = collections.defaultdict(set)
    for option in used:
        for letter, _ in used[option]:
            if letter:
                letters[letter].add(option)
    wrong += [f"-{letter}: means {', '.join(sorted(options))}"
              for letter, options in letters.items() if len(options) > 1]
    print("\n".join(wrong), end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
