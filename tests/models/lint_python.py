"""Compiles Python files, and has pyflakes look at them where it is installed.
    python3 lint_python.py FILES
"""

import sys

status = 0
for name in sys.argv[1:]:
    with open(name) as file:
        text = file.read()
    compile(text, name, "exec")
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > 100 or line != line.rstrip() or "\t" in line:
            print("{}:{}: over 100 characters, a tab or a blank at its end".format(name, number))
            status = 1
try:
    from pyflakes.api import checkPath
except ImportError:
    print("pyflakes is not here: compiled only")
else:
    for name in sys.argv[1:]:
        status = checkPath(name) or status
sys.exit(status)
