# SPDX-License-Identifier: GPL-2.0-or-later
"""The option tables of all commands, tried one by one.

option_tables.py VERSION PROGRAM...: prints each row of --help that is not kept, and exits with 1; prints
nothing and exits with 0 if all are. Of each program:

* --help and -h print the same, exit 0, and fail with one line where nothing can be written;
* an option has one letter in all commands, and a letter one option;
* --version is that of the header, and completion offers the options of --help;
* an unknown option and an unknown letter are bad usage, a misspelt one gets the nearest name;
* a flag takes no argument, and an option that has one must be given it;
* every option takes each of its legal values, as a choice those that completion offers, and refuses
  each illegal one by its name.

The parser reads options in their order: that one is legal is seen by the complaint about the
unknown option behind it. Bad usage is exit 2 with two lines, and nothing on standard output.
"""
import collections
import concurrent.futures
import os
import re
import subprocess
import sys

# What a command needs before it looks at a value that its parser takes as it is; a.fis is a model.
OPERANDS = {
    "bench": ["loop"], "compile": ["a.fis", "-o", "a.fx"], "eval": ["a.fis"],
    "export": ["a.rec"], "haptic": ["neck", "--duration=1s"], "info": ["a.fis"], "plot": ["a.rec", "-o", "a.svg"],
    "replay": ["a.rec", "neck"], "serve": ["--rig=sim:", "--duration=50ms"], "sign": ["a.rec"],
    "train": ["a.csv", "-o", "m.fis"], "view": ["neck", "--procedure"],
}

# OPTION [COMMAND] | legal values | illegal values; a value of {} is empty. The row with a command wins.
VALUES = """
--against | old.json |
--align | clocks tap sync | nosuch {}
--arith | double fixed | float half {}
--at | 500ms,2s,6s | 2s,1s now {}
--average | 12x10 1x1 12x10,by-cut 9x9,depth=0.1,velocity=1e6,count=50 | 12 x 0x5 5x99999 5x5x5 5x5,by-cut=1 5x5,depth 5x5,depth=0 5x5,count=few 5x5,nosuch {}
--axis | 1 3 | 0 4 1.5 {}
--board | 9x6 9x6,5mm | 9 9x 2x2x2 9x6,0 9x6,5kg {}
--budget | 0.1mN 50uN 1e-4 | 5cm 0.1kN -1 0 {}
--ca | file |
--calibration | any.conf |
--calibration export | |
--camera | off auto frames | on pictures frmaes {}
--camera calibrate delay | auto frames | on pictures {}
--camera init | none v4l2:/dev/video0 |
--check | 0.01 0.99 | 0 1 half 0x1p-2 nan {}
--clock-source | auto none kernel ptp ptp:/x,3 chrony:323 sim:1000,0,20 | sundial kernel: ptp: ptp:/x,128 ptp:,1 chrony:0 chrony:x sim:x
--code | P07 a-b_c ABCDEFGHIJKLMNOP | A,B ABCDEFGHIJKLMNOPQ é {}
--cpu | 0 1023 | -1 1024 x {}
--cut | 1 1000 | 0 -1 1.5 first {}
--data | any.csv |
--density | 7950 | 0 -1 heavy {}
--direction | 1,0,0 0,-2.5,1e3 | 1 1,2 0,0,0 1,0,0,0 up,0,0 {}
--due | 7d 365d 100y | soon -1d {}
--duration | 10 30s 0.5min | 0 -1s never 10x 5m nan inf {}
--duration bench | 1s | 0 never {}
--duration demo | 1s 2min | 1ms long {}
--epochs | 1 100000 | 0 1.5 many {}
--every | 10ms 1h | 0 never {}
--force | none sim: |
--from | any |
--gravity | 9.81 latitude=-90 latitude=48,altitude=10000 | 0 -9.81 strong altitude=5 latitude=91 latitude=0,altitude=high {}
--grid | 2x2 20x15 | 20 3x 1x5 x 3x3x3 99999x2 -2x3 {}
--group | cut |
--handle | |
--haptic | none haply: |
--http | 0 8080 127.0.0.1:0 [::1]:0 | name:1 65536 -1 127.0.0.1:x {}
--idle | 1s 10min | 0 never {}
--igtl | 0 18944 127.0.0.1:0 [::1]:0 18944/2 127.0.0.1:0/1 | ::1:0 127.0.0.1:x 127.0.0.1 foo 65536 -1 :0 0/3 0/new
--images | 1 20 | 0 1.5 all {}
--input-range | 0,5000 -5,5 | 5,1 5 a,b {}
--inputs | a a,b | ,
--key | key |
--lead | 0.5 4 | 0 -1 1e4 nan soft {}
--length | 47.5mm 4.75cm 100 | 47.5kg 0 long {}
--load | idle cpu memory disk view | disc {}
--log device | |
--lsl | prefix | {}
--max-delay | 10 1000 | 9 1001 long {}
--max-force | 1N 500mN | 0 1kg strong {}
--method | direct table force table:64 force:4096 | tabel float direct:0 table:4097 table:x {}
--mf | 3,2 auto | 0,3 33,2 , auto,3 a,b
--model | any.fis |
--nominal calibrate depth | 0.1 10 | 0 11 wide {}
--nominal calibrate force | 1 1e5 | 0 1e6 high {}
--only bench all | precision,loop |
--only calibrate check | force force,depth,tip,delay,stepper,frame | forse knife {}
--only capture | force tracker force,tracker | camera {}
--output | |
--overruns | 0 1000000 | -1 1.5 many {}
--pick | |
--pixels | |
--point | 1,-2,3.5 | 1,2 1,2,3,4 a,b,c {}
--policy | fifo deadline fifo:1 fifo:84 | rr fifo:0 fifo:85 fifo:x {}
--poses | arrival acquisition | dawn {}
--premises | any.fis |
--preset | sim paper haply | nosuch
--profile export | plain ros2 | ros {}
--range | 2s..2500ms 5s.. ..1s | 5s 5s..4s {}
--range calibrate stepper | 0mm..1.5mm | 5mm 5mm..1mm {}
--rate | 0.5 1000 | 0 -1 fast nan {}
--rate serve | 1 1000 | 0 -1 fast {}
--rate view | 1 240 | 0 241 fast {}
--recording | any.rec |
--reference | any.session |
--reference-stream | force tracker camera | depth {}
--region | |
--repeat | 1 1000 | 0 1.5 {}
--repeat calibrate force | 1 100 | 0 1.5 {}
--repeat calibrate stepper | 2 100 | 1 101 {}
--revoked | file |
--ridge | 0 1e12 | -1 nan small {}
--report | a.json | a.odd
--rig | sim: any.conf |
--ros2 | neck /lab/neck_2 neck,domain=0 neck,domain=232,interface=lo | {} 2neck a//b a/ a-b neck,domain=233 neck,interface=nosuch0 neck,nosuch=1 neck,domain
--scale | 0.5g 1kg | -1 1mm {}
--scene | any |
--search | type=gaussmf type=gbellmf,sample=0 classic,step=1e-9 | type=trimf starts=1 sample=-1 sample=1.5 classic=1 step=11 nosuch {}
--seed | 0 7 | -1 x 1.5 {}
--seed bench | 1 7 | 0 x {}
--share | 1/1 2/3 mpi | 0/2 3/2 1 a/b {}
--signers | file |
--size | 160x120 1280x720 | 10x10 big 640x480x3 {}
--span | 1 1000 | 0.5 1001 nan long {}
--speed | 0.01 100 | 0 -1 fast {}
--spring | 2 2.5 | 0 -1 1e4 nan soft {}
--start-at | 2037-01-15T08:00:10Z 2037-01-15T08:00:10.5TAI | 2020-02-30T00:00:00Z 2027-01-15T08:00:10 2027-01-15T08:00:10.Z now 2027-01-15T08:00:10+01:00 2027-01-15
--state | none a.state |
--step-mm | 0.001 | 0 -1 x {}
--stepper | none sim: |
--target | column |
--timeout | 2s 1h | 0 never {}
--timestamp | http://a/tsr a.tsq a.tsr | reply.der
--tolerance | 0.1 5 | -1 x {}
--tolerance join | 1ms 0.5s | 0 soon {}
--tool | auto blade handle tube | spoon blad {}
--tracker | none sim: |
--travel | 15 20.5 | 0 -1 1e4 nan soft {}
--trigger | button 0.2N 500mN sync sync:/dev/x | 0N knob -1N {}
--given-u calibrate delay | reference=1 | reference=-1 reference=1001 surface=1 {}
--given-u calibrate depth | length=0.01mm,pixels=0 gauge=100,zero=0 square=1,plane=0.1mm | length=1kg pixels=fine gauge=101 zero=-1 nosuch=1 length {}
--given-u calibrate tip | surface=0.1 | surface=-1 surface=far {}
--uncertainty eval | none total parts | part {}
--uncertainty export | none total parts | part {}
--uncertainty train | none parts | part {}
--url | url.txt |
--viewpoint | 15,45,140 | 1,2 a,b,c {}
--weights | 0,50g,100g,0.2kg | 1,a {}
"""


def read_values():
    values = {}
    for line in VALUES.strip().splitlines():
        name, legal, illegal = (cell.strip() for cell in line.split("|"))
        values[name] = [[("" if v == "{}" else v) for v in cell.split()] for cell in (legal, illegal)]
    return values


def run(program, *arguments, out=subprocess.PIPE):
    done = subprocess.run([program, *arguments], stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.PIPE,
                          text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def rows_of_help(text):
    """(option, letter, argument) of each option that --help lists."""
    options = text.split("\nOptions:\n", 1)[1].split("\n\n", 1)[0]
    for line in options.splitlines():
        found = re.match(r" {2}(?:-(\w), |    )--([a-z0-9-]+)(?: (\S+))?", line)
        if found:
            yield "--" + found[2], found[1] or "", found[3] or ""


class Command:
    def __init__(self, program, values):
        self.program, self.values = program, values
        self.name = os.path.basename(program).split("-", 1)[1].replace("-", " ", 1)
        self.wrong, self.letters = [], []

    def complain(self, *words):
        self.wrong.append(f"incise {self.name}: " + " ".join(words))

    def refused(self, arguments, *texts):
        """These arguments are bad usage; the line holds the texts."""
        code, out, err = run(self.program, *arguments)
        lines = err.splitlines()
        if (code != 2 or out or len(lines) != 2 or not lines[0].startswith(f"incise {self.name}: ") or
                lines[1] != f"Try 'incise {self.name} --help'." or not all(t in lines[0] for t in texts)):
            self.complain(" ".join(arguments), f"expected {texts}, found exit {code}:", out, err)

    def help(self, version):
        code, text, err = run(self.program, "--help")
        if code or err or not text.startswith(f"Usage: incise {self.name} "):
            self.complain("--help:", str(code), err, text[:80])
        if run(self.program, "-h") != (0, text, ""):
            self.complain("-h differs from --help")
        with open("/dev/full", "w", encoding="utf-8") as full:
            code, _, err = run(self.program, "--help", out=full)
        if code != 1 or len(err.splitlines()) != 1:
            self.complain("--help >/dev/full:", str(code), err)
        for option in ("--version", "-V"):
            if run(self.program, option) != (0, f"incise {version}\n", ""):
                self.complain(option, run(self.program, option)[1])
        return text

    def legal(self, options):
        """One value of each option after the other: all are taken, the unknown one behind them is not."""
        left = {name: list(values) for name, values in options.items() if values}
        while left:
            arguments = [f"{name}={values.pop(0)}" for name, values in left.items()]
            left = {name: values for name, values in left.items() if values}
            self.refused([*arguments, "--nosuch"], "--nosuch: no such option")

    def completed(self, *words):
        """What completion offers for the last of these words, without what it leaves to the shell (":files *.c")."""
        lines = run(self.program, "--complete", *words)[1].splitlines()
        return [line.split("\t")[0] for line in lines if not line.startswith(":")]

    def check(self, version):
        # The rows of an option that writes several files are one option.
        rows = {}
        for row in rows_of_help(self.help(version)):
            rows.setdefault(row[0], row)
        rows = list(rows.values())
        self.letters = [(name, letter) for name, letter, _ in rows]
        self.refused(["--no-such-option"], "--no-such-option: no such option")
        self.refused(["-%"], "-%")
        names = [name for name, _, _ in rows]
        flags = [f for name, letter, argument in rows if not argument and name not in ("--help", "--version")
                 for f in (name, letter and "-" + letter) if f]
        # The parser is the same for all options of a command: one of each kind.
        longest = max(names, key=len)
        middle = (len(longest) + 2) // 2
        self.refused([longest[:middle] + "q" + longest[middle:]], f"did you mean {longest}?")
        self.refused(["--help=yes"], "--help: this option takes no argument")
        self.refused([*flags, "--nosuch"], "--nosuch: no such option")
        for name, letter, argument in [row for row in rows if row[2]][:1]:
            self.refused([name], f"{name}: missing argument {argument}")
            if letter:
                self.refused(["-" + letter], f"-{letter}: missing argument {argument}")
        legal = {}
        for name, letter, argument in rows:
            if not argument:
                continue
            values = self.values.get(f"{name} {self.name}", self.values.get(name))
            if values is None:
                self.complain(f"{name}: has no row in option_tables.py")
                continue
            offered = [word for word in self.completed(name, "") if values[1] and not word.endswith("=")]
            legal[name] = list(dict.fromkeys(values[0] + offered))
            if letter and values[0]:
                self.refused(["-" + letter, values[0][0], "--nosuch"], "--nosuch: no such option")
            for value in values[1]:
                said = "clock source" if name == "--clock-source" else name
                self.refused([*OPERANDS.get(self.name, []), f"{name}={value}"], said)
        if sorted(self.completed("--")) != sorted(names):
            self.complain("completion offers", *self.completed("--"))
        # The beginning of several names is none of them.
        for name in names:
            if name[:-1] not in names and sum(n.startswith(name[:-1]) for n in names) > 1:
                self.refused([name[:-1] + "="], "ambiguous")
        self.legal(legal)
        return self.wrong


def main(version, programs):
    values = read_values()
    commands = [Command(program, values) for program in programs]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        wrong = [line for lines in pool.map(lambda c: c.check(version), commands) for line in lines]
    for words in zip(*{pair for command in commands for pair in command.letters}):
        wrong += [f"{word}: stands for several" for word, n in collections.Counter(words).items() if word and n > 1]
    if wrong:
        print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
