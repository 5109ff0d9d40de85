#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Reads Prometheus' text format 0.0.4 from standard input, strictly, and prints each sample
as NAME LABEL=VALUE… NUMBER. Complains, and exits with 1, where the format, or what a metric of
that type promises, is not kept.
"""
import math
import re
import sys

NAME = re.compile(r'[a-zA-Z_:][a-zA-Z0-9_:]*')
LABEL = re.compile(r'([a-zA-Z_][a-zA-Z0-9_]*)="((?:[^"\\\n]|\\[\\"n])*)"')
UNITS = ('_seconds', '_hertz', '_newtons', '_joules', '_total', '_info', '_alive', '_state',
         '_tool')
TYPES = ('counter', 'gauge', 'histogram')


def fail(line, why):
    sys.exit(f'{why}: {line!r}')


def unescape(value):
    return re.sub(r'\\(.)', lambda m: '\n' if m[1] == 'n' else m[1], value)


def number(line, text):
    if not re.fullmatch(r'[-+]?(Inf|NaN|[0-9.]+([eE][-+]?[0-9]+)?)', text):
        fail(line, 'no number')
    return float(text)


def sample(line):
    match = NAME.match(line)
    if not match:
        fail(line, 'no name')
    name, at, labels = match[0], match.end(), {}
    if line[at:at + 1] == '{':
        at += 1
        while line[at] != '}':
            match = LABEL.match(line, at)
            if not match or match[1] in labels:
                fail(line, 'no label')
            labels[match[1]] = unescape(match[2])
            at = match.end() + (line[match.end()] == ',')
        at += 1
    if line[at] != ' ' or ' ' in line[at + 1:]:
        fail(line, 'one space and a number')
    return name, labels, number(line, line[at + 1:])


def check_histogram(family, rows):
    series = {}
    for name, labels, value in rows:
        key = tuple(sorted((k, v) for k, v in labels.items() if k != 'le'))
        series.setdefault(key, {}).setdefault(name[len(family):], []).append((labels, value))
    for parts in series.values():
        if set(parts) != {'_bucket', '_sum', '_count'}:
            fail(family, 'not all of a histogram')
        bounds = [float(labels['le']) for labels, _ in parts['_bucket']]
        counts = [value for _, value in parts['_bucket']]
        if bounds != sorted(set(bounds)) or bounds[-1] != math.inf:
            fail(family, 'bounds do not grow to +Inf')
        if counts != sorted(counts) or counts[-1] != parts['_count'][0][1]:
            fail(family, 'counts do not grow to all')


def check(families):
    for family, (kind, rows) in families.items():
        if not rows:
            fail(family, 'no sample')
        if not family.endswith(UNITS):
            fail(family, 'no base unit')
        if (kind == 'counter') != family.endswith('_total'):
            fail(family, 'counters, and only they, end with _total')
        if kind == 'histogram':
            check_histogram(family, rows)
        seen = [(name, tuple(sorted(labels.items()))) for name, labels, _ in rows]
        if len(seen) != len(set(seen)):
            fail(family, 'twice')
        if kind != 'gauge' and any(value < 0 for _, _, value in rows):
            fail(family, 'below 0')


def main():
    text = sys.stdin.read()
    if not text.endswith('\n'):
        fail(text[-20:], 'the last line does not end')
    families, helped, family = {}, None, None
    for line in text.split('\n')[:-1]:
        if line.startswith('# HELP '):
            helped = line.split(' ')[2]
            if helped in families:
                fail(line, 'a family that comes again')
        elif line.startswith('# TYPE '):
            _, _, family, kind = line.split(' ')
            if family != helped or kind not in TYPES:
                fail(line, 'type without help, or none')
            families[family] = kind, []
        else:
            name, labels, value = sample(line)
            kind = families[family][0] if family else None
            ends = ('_bucket', '_sum', '_count') if kind == 'histogram' else ('',)
            if name not in [f'{family}{end}' for end in ends]:
                fail(line, f'not of {family}')
            families[family][1].append((name, labels, value))
            print(name, *(f'{k}={v}' for k, v in labels.items()), repr(value))
    check(families)


main()
