#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks the size of what a reader has to hold in mind: files, functions and parameter lists.

Not a C++ parser: it knows as much of the language as this package's code uses.
"""
import ast
import bisect
import os
import re
import sys
import tempfile
import unittest

from source_files import source_files

FOLDERS = ('src', 'cuda', 'include', 'bench', 'test', 'fuzz', 'examples', 'scripts')
SUFFIXES = ('.h', '.cpp', '.inl', '.cuh', '.cu', '.py')
MAX_FILE_LINES = 400
MAX_FUNCTION_LINES = 60
MAX_PARAMETERS = 5
MAX_PUBLIC_HEADERS = 16

# Files that do not keep the limits yet.
NOT_YET = ()

# Comments, preprocessor lines, and literals. (A ' between digits separates them.)
NOT_CODE = re.compile(
    r'//(?:\\\n|[^\n])*'
    r'|/\*.*?\*/'
    r'|^[ \t]*\#(?:\\\n|[^\n])*'
    r'|R"(?P<delimiter>[^(\s]*)\(.*?\)(?P=delimiter)"'
    r'|"(?:\\.|[^"\\\n])*"'
    r"|(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+'",
    re.MULTILINE | re.DOTALL)
OPENING, CLOSING = '([{', ')]}'

# What may stand before a parameter list: a name, an operator, or a lambda's captures.
NAME = re.compile(r'(~?\w+|\boperator\s*(?:\(\s*\)|\[\s*\]|[^\s\w()]{1,3})|\])\s*(?:<[^<>(){};]*>\s*)?$')
NOT_A_FUNCTION = {'if', 'for', 'while', 'switch', 'catch', 'return', 'sizeof', 'alignof', 'alignas', 'decltype',
                  'noexcept', 'static_assert', 'defined', '__attribute__', '__launch_bounds__', '__align__'}
# What may stand between a parameter list and the body.
QUALIFIERS = re.compile(r'(?:\s|const\b|mutable\b|override\b|final\b|&|noexcept\b(?:\s*\([^()]*\))?'
                        r'|->\s*[\w:]+(?:\s*<[^;{}()]*>)?[\s*&]*|try\b)*')
HANDLER = re.compile(r'\s*catch\s*(?=\()')
INITIALISER = re.compile(r'\s*[:,]\s*[\w:]+\s*(?:<[^;{}()]*>\s*)?(?=[({])')


class Source:
    """The code of a file: its comments, literals and directives are blank, its lines are as they were."""

    def __init__(self, text):
        def blank(match):
            filler = '0' if match.group()[0] in '"\'R' else ' '  # a literal still counts as an argument
            return re.sub(r'[^\n]', filler, match.group())
        self.code = NOT_CODE.sub(blank, text)
        self.line_starts = [0] + [i + 1 for i, c in enumerate(text) if c == '\n']
        self.partner = {}
        open_brackets = []
        for i, c in enumerate(self.code):
            if c in OPENING:
                open_brackets.append(i)
            elif c in CLOSING and open_brackets:
                self.partner[open_brackets.pop()] = i

    def line(self, position):
        return bisect.bisect(self.line_starts, position)

    def functions(self):
        """Yields (name, first line, last line, number of parameters) of what has a body or is declared."""
        body_start = 0  # of the last function: before it stand its parameters and initialisers
        body_end = 0  # of the outermost function: what ends with a semicolon in it is a call
        for start, end in sorted(self.partner.items()):
            if self.code[start] != '(' or start < body_start:
                continue
            body = self.body(end + 1)
            if body is None and (start < body_end or not self.is_declaration(start, end)):
                continue
            named = NAME.search(self.code, max(0, start - 100), start)
            if named is None or named.group(1) in NOT_A_FUNCTION:
                continue
            last = self.end_of(body) if body is not None else end
            yield named.group(1), self.line(named.start()), self.line(last), len(self.split(start, end))
            if body is not None:
                body_start = body
                body_end = max(body_end, last)

    def body(self, position):
        """The opening brace of the body that belongs to a parameter list that ends at position, or None."""
        position = QUALIFIERS.match(self.code, position).end()
        initialiser = INITIALISER.match(self.code, position)
        while initialiser and self.code[position] in ':,':
            position = self.skip_space(self.partner[initialiser.end()] + 1)
            initialiser = INITIALISER.match(self.code, position)
        return position if self.code[position:position + 1] == '{' and position in self.partner else None

    def end_of(self, body):
        """The last brace of a body, or of its handlers where the function is a try block."""
        end = self.partner[body]
        while handler := HANDLER.match(self.code, end + 1):
            end = self.partner[self.skip_space(self.partner[handler.end()] + 1)]
        return end

    def is_declaration(self, start, end):
        """Whether a bracket outside all bodies holds parameters: each a type, and mostly a name."""
        after = QUALIFIERS.match(self.code, end + 1).end()
        if not re.match(r';|=\s*(0|default|delete)\s*;', self.code[after:after + 20]):
            return False
        return all(re.match(r'[\w:<>,\s]+[\s&*]+\w*', p) for p in self.split(start, end))

    def split(self, start, end):
        """The text of a bracket, divided at the commas that are in no other bracket."""
        parts, depth, part = [], 0, start + 1
        for i in range(start + 1, end):
            c = self.code[i]
            if c in OPENING or c == '<':
                depth += 1
            elif c in CLOSING or (c == '>' and self.code[i - 1] != '-'):
                depth -= 1
            elif c == ',' and depth == 0:
                parts.append(self.code[part:i])
                part = i + 1
        parts.append(self.code[part:end])
        return [p for p in parts if p.strip() not in ('', 'void')]

    def skip_space(self, position):
        while self.code[position:position + 1].isspace():
            position += 1
        return position


def python_functions(text):
    """Yields the same of a Python file; `self` is no parameter."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            names = [a.arg for a in node.args.posonlyargs + node.args.args + node.args.kwonlyargs]
            yield node.name, node.lineno, node.end_lineno, len(names) - (names[:1] == ['self'])


def violations_of_file(path, text):
    lines = text.count('\n')
    if lines > MAX_FILE_LINES:
        yield f'{path}: {lines} lines, at most {MAX_FILE_LINES}'
    is_python = path.endswith('.py') or '.' not in os.path.basename(path)
    functions = python_functions(text) if is_python else Source(text).functions()
    for name, first, last, parameters in functions:
        if last - first + 1 > MAX_FUNCTION_LINES:
            yield f'{path}:{first}: {name} has {last - first + 1} lines, at most {MAX_FUNCTION_LINES}'
        if parameters > MAX_PARAMETERS:
            yield f'{path}:{first}: {name} has {parameters} parameters, at most {MAX_PARAMETERS}'


def programs(top):
    """Yields the paths, below `top`, of Python programs of scripts/, whose names have no ending."""
    folder = os.path.join(top, 'scripts')
    for name in sorted(os.listdir(folder) if os.path.isdir(folder) else ()):
        path = os.path.join(folder, name)
        if '.' not in name and os.path.isfile(path):
            with open(path, encoding='utf-8') as file:
                if 'python' in file.readline():
                    yield os.path.relpath(path, top)


def violations(top):
    for path in (*source_files(top, FOLDERS, SUFFIXES), *programs(top)):
        with open(os.path.join(top, path), encoding='utf-8') as file:
            yield from violations_of_file(path, file.read())
    headers = os.listdir(os.path.join(top, 'include', 'nerf_pose_refiner'))
    if len(headers) > MAX_PUBLIC_HEADERS:
        yield f'include/nerf_pose_refiner: {len(headers)} headers, at most {MAX_PUBLIC_HEADERS}'


class Functions(unittest.TestCase):
    """The scanner itself: what it takes for a function, and how it counts."""

    def parameters_of(self, text):
        return [(name, parameters) for name, _, _, parameters in Source(text).functions()]

    def test_parameters(self):
        for text, expected in (
                ('void f() {}', [('f', 0)]),
                ('void f(void);', [('f', 0)]),
                ('int f(int a, const std::map<int, std::pair<int, int>>& b = {}, int c = g(1, 2)) { return a; }',
                 [('f', 3)]),
                ('void f(const std::function<void(int, int)>& visit, int (&array)[2]);', [('f', 2)]),
                ('void f(int a,  // one, two, three\n       /* four, five, */ int b) {}', [('f', 2)]),
                ('template <typename A, typename B>\nB Class<A>::f(A a, B b) const noexcept { return {}; }',
                 [('f', 2)]),
                ('Class::Class(int a, int b) : a_(a), b_{b}, c_(g(1, 2)) {}', [('Class', 2)]),
                ('class C : public B {\n  C(int a, int b) : B(a), b_(b) {}\n  ~C() override;\n'
                 '  virtual void f(int a, int b) const = 0;\n  C(const C&) = delete;\n};',
                 [('C', 2), ('~C', 0), ('f', 2), ('C', 1)]),
                ('bool operator==(const A& a, const A& b) { return a.x == b.x; }', [('operator==', 2)]),
                ('float operator()(int a) const { return 0; }', [('operator()', 1)]),
                ('const auto f = [&](int a, int b) { return g(a, b, 1, 2, 3, 4); };', [(']', 2)]),
                ('__global__ void __launch_bounds__(128, 4)\n    kernel(const float* in, float* out) {}',
                 [('kernel', 2)]),
                ('TEST(Suite, name) { f(1, 2, 3, 4, 5, 6); }', [('TEST', 2)]),
                ('int main(int argc, char** argv) try {\n} catch (const E& e) {\n}', [('main', 2)]),
                ('auto f(int a) -> std::vector<int> { return {a}; }', [('f', 1)])):
            self.assertEqual(self.parameters_of(text), expected, text)

    def test_what_is_no_function(self):
        for text in ('const Class object(1, 2, 3, 4, 5, 6);', '#define F(a, b, c, d, e, f) \\\n  g(a) {}',
                     '// void f(int a, int b) {}', 'const char* s = "void f(int a) {}";',
                     "const char c[] = {'(', '{'};", 'static_assert(sizeof(int) == 4, "");',
                     'R"(void f(int a) {})";', 'int a[] = {f(1, 2, 3, 4, 5, 6)};'):
            self.assertEqual(self.parameters_of(text), [], text)

    def test_lines_are_counted_from_the_name_to_the_closing_bracket(self):
        text = '/// Does it.\nint\nf(int a,\n  int b) {\n  if (a) {\n    g();\n  }\n}\n'
        self.assertEqual(list(Source(text).functions()), [('f', 3, 8, 2)])

    def test_python(self):
        text = 'class C:\n    def f(self, a, *, b):\n        return a\n\n\ndef g():\n    pass\n'
        self.assertEqual(list(python_functions(text)), [('g', 6, 7, 0), ('f', 2, 3, 2)])


class Limits(unittest.TestCase):
    """Each kind of violation is seen, and what is just within the limits is not."""

    def check(self, path, text):
        return [v.split(' has ')[-1].split(', ')[0] for v in violations_of_file(path, text)]

    def test_parameters(self):
        for kind in ('void f({});', 'void f({}) {{}}', '__global__ void k({}) {{}}', 'C::C({}) : a_(a0) {{}}',
                     'class C {{ virtual void f({}) = 0; }};', 'void g() {{ const auto f = [&]({}) {{}}; }}'):
            for count in (5, 6):
                text = kind.format(', '.join(f'int a{i}' for i in range(count)))
                expected = ['6 parameters'] if count == 6 else []
                self.assertEqual(self.check('src/a.cpp', text), expected, text)
        self.assertEqual(self.check('test/a.py', 'def f(a, b, c, d, e, f):\n    pass\n'), ['6 parameters'])

    def test_lines(self):
        for lines in (60, 61):
            expected = ['61 lines'] if lines == 61 else []
            self.assertEqual(self.check('src/a.cpp', 'void f() {' + '\n' * (lines - 1) + '}'), expected)
            self.assertEqual(self.check('test/a.py', 'def f():' + '\n' * (lines - 1) + '    pass'), expected)
        self.assertEqual(self.check('src/a.h', '\n' * 400), [])
        self.assertEqual(self.check('src/a.h', '\n' * 401), ['src/a.h: 401 lines'])

    def test_public_headers(self):
        with tempfile.TemporaryDirectory() as top:
            folder = os.path.join(top, 'include', 'nerf_pose_refiner')
            os.makedirs(folder)
            for i in range(MAX_PUBLIC_HEADERS + 1):
                self.assertEqual(list(violations(top)), [])
                with open(os.path.join(folder, f'{i}.h'), 'w', encoding='utf-8'):
                    pass
            self.assertEqual(len(list(violations(top))), 1)


class Tree(unittest.TestCase):
    TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

    def test_sizes_of_this_package(self):
        found = list(violations(self.TOP))
        self.assertEqual(found, [], '\n' + '\n'.join(found))

    def test_it_saw_functions_of_every_folder(self):
        seen = {path.split('/')[0] for path in source_files(self.TOP, FOLDERS, SUFFIXES)}
        self.assertEqual(seen, set(FOLDERS))
        self.assertIn('scripts/photos_to_object', programs(self.TOP))


if __name__ == '__main__':
    sys.exit(unittest.main())
