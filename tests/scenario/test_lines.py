"""The line of every key of a TOML text."""

import tomllib

from jaxsat.scenario.lines import line_map, nearest_line
from scenario.documents import every_location


def test_line_map():
    text = '''\
# a comment with [brackets] and = signs
top = "a # no comment"
"quoted key" = 'single'
long = """
[not.a.table]
x = 1 \\""" still text
"""
raw = \'\'\'
] }\'\'\'
[ a . b ]   # comment
list = [ # comment ]
  [1, 2],
  { x = 1, y.z = [
     3 ] },
]
date = 1979-05-27 07:32:00
dotted."k.e y".x = true
[[many]]
v = 1
[[many]]
v = 2
[a]
last = -inf'''
    data = tomllib.loads(text)
    lines = line_map(text)
    expected = {
        ("top",): 2,
        ("quoted key",): 3,
        ("long",): 4,
        ("raw",): 8,
        ("a",): 22,
        ("a", "b"): 10,
        ("a", "b", "list"): 11,
        ("a", "b", "list", 0): 12,
        ("a", "b", "list", 0, 1): 12,
        ("a", "b", "list", 1): 13,
        ("a", "b", "list", 1, "x"): 13,
        ("a", "b", "list", 1, "y", "z", 0): 14,
        ("a", "b", "date"): 16,
        ("a", "b", "dotted", "k.e y", "x"): 17,
        ("many", 0): 18,
        ("many", 1, "v"): 21,
        ("a", "last"): 23,
    }
    assert {key: lines.get(key) for key in expected} == expected
    assert set(every_location(data)) == set(lines)
    assert nearest_line(lines, ("a", "b", "missing", 3)) == 10
    assert nearest_line(lines, ("nothing",)) == 1
