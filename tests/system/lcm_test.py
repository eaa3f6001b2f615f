"""The LCM face over real UDP multicast: in network namespaces of the test's own, so that nothing leaves the machine,
against LCM's library, lcm-logger and lcm-logplayer.

    lcm_test.py STILLMAP LCM_PROBE [TEST]...      77: namespaces are not permitted here
"""

import concurrent.futures
import os
import pathlib
import pty
import random
import re
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

URL = "udpm://239.255.76.67:7667?ttl=0"
URL_OF_NETWORK = "udpm://239.255.76.67:7667?ttl=1"
PATIENT_URL = URL + "&recv_buf_size=4194304"
GROUP = ("239.255.76.67", 7667)
PATIENCE_S = 60
AT_A_TIME = 5

STILLMAP = PROBE = ""


class Host:
    """A machine of its own as far as the network goes; it ends with the `with`."""

    def __init__(self, multicast_by="lo"):
        self.programs = []
        self.keeper = subprocess.Popen(["unshare", "-n", "sh", "-c", "echo; exec sleep 1000"], stdout=subprocess.PIPE)
        self.keeper.stdout.readline()  # now it is in its own namespace
        self.do("ip", "link", "set", "lo", "up", "multicast", "on")
        if multicast_by:
            self.route(multicast_by)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for program in [*self.programs, self.keeper]:
            if program.poll() is None:
                program.kill()
            program.communicate()

    def within(self, *command):
        return ["nsenter", "-t", str(self.keeper.pid), "-n", *map(str, command)]

    def do(self, *command):
        return subprocess.run(self.within(*command), check=True, capture_output=True, text=True).stdout

    def route(self, device):
        self.do("ip", "route", "add", "224.0.0.0/4", "dev", device)

    def start(self, *command, ready=False):
        program = subprocess.Popen(self.within(*command), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        self.programs.append(program)
        if ready:
            line = program.stdout.readline()
            if line != "ready\n":
                raise AssertionError(f"{command}: {line} {program.communicate()}")
        return program

    def probe(self, *arguments):
        return self.start(PROBE, *arguments, ready=True)

    def top(self, *arguments):
        return self.start(STILLMAP, "top", *arguments)


def two_hosts():
    """Joined by a cable: (robot, ground), both with their multicast route to it."""
    robot, ground = Host(None), Host(None)
    subprocess.run(["ip", "link", "add", "robot0", "netns", str(robot.keeper.pid), "type", "veth", "peer", "name",
                    "ground0", "netns", str(ground.keeper.pid)], check=True)
    for host, device, address in [(robot, "robot0", "10.77.0.1/24"), (ground, "ground0", "10.77.0.2/24")]:
        host.do("ip", "address", "add", address, "dev", device)
        host.do("ip", "link", "set", device, "up")
        host.route(device)
    return robot, ground


def end_of(program):
    """(exit code, output) once it is done; listeners end when their input does."""
    out, errors = program.communicate(timeout=PATIENCE_S)
    return program.returncode, out + errors


def numbers(text):
    """{"sent": 3, ...} of "sent 3 ..."."""
    return {name: int(value) for name, value in re.findall(r"(\w+) (-?\d+)\b", text)}


def result(program):
    code, text = end_of(program)
    assert code == 0, text
    return numbers(text)


def command(number, kind=4, name=""):
    """A command_t on its channel, in a datagram."""
    text = name.encode() + b"\0"
    return (b"LC02" + struct.pack(">I", number) + b"STILLMAP_COMMAND\0"
            + struct.pack(">QqibI", 0x1A187596C10F0700, 1, number, kind, len(text)) + text)


SENDER = """
import socket, sys, time
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
for line in sys.stdin:
    out.sendto(bytes.fromhex(line), ("%s", %d))
    time.sleep(0.001)
""" % GROUP


def send(host, datagrams):
    lines = "".join(datagram.hex() + "\n" for datagram in datagrams)
    subprocess.run(host.within(sys.executable, "-c", SENDER), input=lines, text=True, check=True, timeout=PATIENCE_S)


def wrong_datagrams(channel, good, count, seed=5):
    """Ones that are no LCM, and LCM's with wrong payloads; (datagrams, how many of them name the channel)."""
    randomly = random.Random(seed)
    datagrams, named = [], 0
    head = b"LC02" + struct.pack(">I", 7)
    for index in range(count):
        kind = index % 6
        if kind == 0:
            datagram = randomly.randbytes(randomly.randrange(1400))
        elif kind == 1:  # the channel without its end
            datagram = head + channel[:randomly.randrange(len(channel) + 1)]
        elif kind == 2:  # a channel longer than any
            datagram = head + b"C" * 200 + b"\0" + good
        elif kind == 3:  # cut short
            datagram = head + channel + b"\0" + good[:randomly.randrange(len(good))]
            named += 1
        elif kind == 4:  # the first fragment of a giant
            datagram = b"LC03" + struct.pack(">IIIHH", index, (1 << 28) - 1, 0, 0, 60000) + channel + b"\0" + good
            named += 1
        else:  # another type
            datagram = head + channel + b"\0" + randomly.randbytes(8) + good[8:]
            named += 1
        datagrams.append(datagram)
    return datagrams, named


class Published(unittest.TestCase):
    def test_who_knows_only_bot_core_hears_the_poses(self):
        with Host() as host:
            listener = host.probe("bot-core", URL)
            self.assertEqual(result(host.probe("publish", URL, 100, 100))["unavailable"], 0)
            self.assertEqual(result(listener), {"poses": 100, "first": 0, "last": 99, "wrong": 0})

    def test_logger_and_logplayer(self):
        with tempfile.TemporaryDirectory() as folder, Host() as host:
            log = pathlib.Path(folder) / "flight.lcmlog"
            logger = host.start("lcm-logger", "-q", "--lcm-url=" + URL, log)
            give_up = time.monotonic() + PATIENCE_S
            while not log.exists() or log.stat().st_size == 0:  # until it listens
                self.assertLess(time.monotonic(), give_up)
                result(host.probe("publish", URL, 1, 20))
            before = log.read_bytes().count(b"STILLMAP_POSE")
            result(host.probe("publish", URL, 100, 200))
            while log.read_bytes().count(b"STILLMAP_POSE") < before + 100:
                self.assertLess(time.monotonic(), give_up)
                result(host.probe("publish", URL, 1, 20))  # it writes out what it has when the next comes
            logger.send_signal(signal.SIGINT)
            end_of(logger)
            self.assertIn(b"STILLMAP_STATUS", log.read_bytes())

            listener = host.probe("bot-core", URL)
            player = host.start("lcm-logplayer", "--speed=2", "--lcm-url=" + URL, log)
            self.assertEqual(end_of(player)[0], 0)
            self.assertEqual(result(listener), {"poses": 100, "first": 0, "last": 99, "wrong": 0})

    def test_two_hosts_hear_each_other_with_ttl_1_only(self):
        robot, ground = two_hosts()
        with robot, ground:
            far, near = ground.probe("bot-core", URL_OF_NETWORK), robot.probe("bot-core", URL)
            result(robot.probe("publish", URL, 50, 100))  # ttl 0: x = 0..49 stays
            result(robot.probe("publish", URL_OF_NETWORK, 60, 100))
            self.assertEqual(result(near)["poses"], 60)
            self.assertEqual(result(far)["poses"], 60, "all of ttl 1")
            # Linux sends datagrams of ttl 0 as any other where nobody on the device is a member of the group.
            far = ground.probe("bot-core", URL_OF_NETWORK)
            self.assertEqual(result(robot.probe("publish", URL, 50, 100))["sent"], 100)
            self.assertEqual(result(far)["poses"], 0, "none of ttl 0")

    def test_no_route_and_one_that_comes_later(self):
        with Host(multicast_by=None) as host:
            publisher = host.probe("publish", URL, 400, 100)
            time.sleep(0.7)
            host.route("lo")
            listener = host.probe("bot-core", URL)  # LCM's library, unlike ours, needs the route at its start
            sent, heard = result(publisher), result(listener)
            self.assertGreater(sent["unavailable"], 50)
            self.assertGreater(sent["sent"], 50)
            self.assertGreater(heard["poses"], 25)
            self.assertEqual(heard["last"], 399)

    def test_a_link_that_goes_down_and_comes_back(self):
        robot, ground = two_hosts()
        with robot, ground:
            listener = ground.probe("bot-core", URL_OF_NETWORK)
            publisher = robot.probe("publish", URL_OF_NETWORK, 400, 100)
            time.sleep(0.7)
            robot.do("ip", "link", "set", "robot0", "down")
            time.sleep(0.7)
            robot.do("ip", "link", "set", "robot0", "up")
            robot.route("robot0")  # it went with the link
            sent, heard = result(publisher), result(listener)
            self.assertGreater(sent["unavailable"], 60)
            self.assertEqual((heard["first"], heard["last"], heard["wrong"]), (0, 399, 0))
            self.assertGreater(heard["poses"], 100)
            self.assertLess(sent["longest_ms"], 500)

    def slow_down(self, robot, queue_bytes):
        try:
            robot.do("tc", "qdisc", "add", "dev", "robot0", "root", "tbf", "rate", "200kbit", "burst", "4k", "limit",
                     queue_bytes)
        except subprocess.CalledProcessError as error:
            self.skipTest("this kernel has no tbf: " + error.stderr)

    def test_a_slow_link_makes_nobody_wait(self):
        robot, ground = two_hosts()
        with robot, ground:
            self.slow_down(robot, "10m")  # it keeps what it cannot send; LCM's own publish waits for seconds here
            sent = result(robot.probe("publish", URL_OF_NETWORK, 1000, 1000))
            self.assertGreater(sent["unavailable"], 0)
            self.assertLess(sent["longest_ms"], 500)

    def test_loss(self):
        robot, ground = two_hosts()
        with robot, ground:
            self.slow_down(robot, "4k")  # it throws away what it cannot send
            listener = ground.probe("bot-core", URL_OF_NETWORK)
            result(robot.probe("publish", URL_OF_NETWORK, 200, 200))
            heard = result(listener)
            self.assertGreater(heard["poses"], 10)
            self.assertLess(heard["poses"], 190)
            self.assertEqual(heard["wrong"], 0)


class Heard(unittest.TestCase):
    def assert_counted(self, text, named):
        """On a busy machine the system may lose some before anybody sees them; network_test counts exactly."""
        refused = numbers(text)["refused"]
        self.assertLessEqual(refused, named)
        self.assertGreater(refused, 0.8 * named)

    def test_foreign_and_broken_messages_do_no_harm(self):
        good = command(41, kind=2, name="hall.ply")
        payload = good[good.index(b"\0", 8) + 1:]
        wrong, named = wrong_datagrams(b"STILLMAP_COMMAND", payload, 1200)
        with Host() as host:
            listener = host.probe("commands", PATIENT_URL)
            send(host, [command(40), *wrong, good])
            code, text = end_of(listener)
        self.assertEqual(code, 0)
        *commands, refused = text.splitlines()
        self.assertEqual(commands, ["command 40 kind 4 file ''", "command 41 kind 2 file 'hall.ply'"])
        self.assert_counted(refused, named)

    def test_odometry_among_broken_messages(self):
        pose = struct.pack(">Qq16d", 0x2E16EFB052B0105E, 10 ** 15, 1.25, 0, 0, 0, 0, 0, 1, *[0.0] * 9)
        good = b"LC02" + struct.pack(">I", 1) + b"ODOMETRY\0" + pose
        wrong, named = wrong_datagrams(b"ODOMETRY", pose, 600)
        with Host() as host:
            listener = host.probe("odometry", PATIENT_URL)
            send(host, [*wrong, good])
            code, text = end_of(listener)
        self.assertEqual(code, 0)
        self.assertTrue(text.startswith("odometry x 1.250 refused "), text)
        self.assert_counted(text, named)

    def test_a_host_without_multicast_joins_when_it_comes(self):
        with Host(multicast_by=None) as host:
            listener = host.probe("commands", URL)
            host.route("lo")
            give_up = time.monotonic() + PATIENCE_S
            while not select.select([listener.stdout], [], [], 0.2)[0]:  # it looks once a second
                self.assertLess(time.monotonic(), give_up)
                send(host, [command(9)])
            self.assertIn("command 9 ", end_of(listener)[1])


class Commanded(unittest.TestCase):
    """A robot, and who tells it what to do on another host."""

    ACCEPTED, DONE, FAILED, REFUSED = 1, 2, 3, 4

    def setUp(self):
        self.out = pathlib.Path(tempfile.mkdtemp()) / "run"
        self.addCleanup(shutil.rmtree, self.out.parent, ignore_errors=True)
        self.robot, self.ground = two_hosts()
        self.addCleanup(self.ground.__exit__)
        self.addCleanup(self.robot.__exit__)
        self.answers = self.ground.probe("answers", URL_OF_NETWORK)
        self.run_ = self.robot.start(
            STILLMAP, "run", "--source", "synthetic:static,size=80x60,seconds=600", "--realtime", "--lcm", URL_OF_NETWORK, "--quiet",
            "--out", self.out, *[f"--set={each}" for each in [
                "lcm.commands=true", "runtime.threads=1", "map.voxel_m=0.04", "map.truncation_m=0.16", "map.pool_blocks=20000"]])

    def answer(self, number, *results):
        """Waits until the status says that of the command. @return the epoch of the poses"""
        deadline, seen = time.monotonic() + PATIENCE_S, []
        while time.monotonic() < deadline and select.select([self.answers.stdout], [], [], PATIENCE_S)[0]:
            seen.append(numbers(self.answers.stdout.readline()))
            if seen[-1]["command"] == number and seen[-1]["result"] in results:
                return seen[-1]["epoch"]
        self.fail(f"no {results} for command {number}, but {seen}")

    def tell(self, number, kind, name, *results):
        send(self.ground, [command(number, kind, name)])
        return self.answer(number, *results)

    def test_a_map_a_mesh_a_new_map_and_an_end(self):
        self.answer(0, 0)  # the first status
        self.tell(1, 1, "hall.smap", self.DONE)
        saved = (self.out / "hall.smap").stat().st_size
        self.tell(2, 2, "hall.ply", self.DONE)
        self.assertTrue((self.out / "hall.ply").read_bytes().startswith(b"ply"))
        before = self.tell(3, 1, "../outside.smap", self.REFUSED)
        self.assertFalse((self.out.parent / "outside.smap").exists())
        self.tell(5, 3, "", self.DONE)
        self.assertEqual(self.tell(6, 1, "", self.DONE), before + 1)  # poses of a new map
        send(self.ground, [command(7, 4)])
        code, text = end_of(self.run_)
        self.assertEqual(code, 0, text)
        self.assertGreater(saved, 100000)
        self.assertGreater((self.out / "map.smap").stat().st_size, 100000)
        self.assertTrue((self.out / "report.json").exists())


class Top(unittest.TestCase):
    LINE = ("mode degraded  tracking poor  30.0 frames/s  {} poses/s  age 12.2 ms  prepare 1.5 track 2.5 mask 3.5 "
            "refine 4.5 integrate 5.5 total 17.5 ms  map 12 % full  dropped 11 frames 12 results  late 13  "
            "left out: finest level  faults: ")

    def test_a_line_a_second_into_a_pipe_until_the_signal(self):
        with Host() as host:
            top = host.top("--lcm", URL)
            publisher = host.probe("publish", URL, 400, 100)
            lines = [top.stdout.readline() for _ in range(4)]
            top.send_signal(signal.SIGINT)
            code, _ = end_of(top)
            end_of(publisher)
        self.assertEqual(code, 0)
        line = lines[2]
        rate = re.search(r"([\d.]+) poses/s", line)
        self.assertIsNotNone(rate, line)
        self.assertTrue(line.startswith(self.LINE.format(rate.group(1))), line)
        self.assertGreater(float(rate.group(1)), 30)
        self.assertLess(float(rate.group(1)), 110)
        # 0x8000000000C00005: bits 0, 2, 22, 23 and 63, which only a newer program has a name for
        self.assertIn("bad_frame 100 now, camera_gone 102, range_lost 122 now, range_stuck 123", line)
        self.assertIn("fault 63", line)

    def test_the_screen_of_a_terminal(self):
        master, slave = pty.openpty()
        with Host() as host:
            publisher = host.probe("publish", URL, 300, 100)
            top = subprocess.Popen(host.within(STILLMAP, "top", "--for", "2"), stdout=slave, close_fds=True)
            os.close(slave)
            text = read_all(master)
            self.assertEqual(top.wait(PATIENCE_S), 0)
            end_of(publisher)
        self.assertGreater(text.count("\033[H"), 3)
        for words in ["mode      degraded", "tracking  poor   sure 75 %   inliers 50 %   masked 25 %", "y 2.250",
                      "rate      30.0 frames a second   pose age 12.2 ms   frame 4000000001",
                      "54321 blocks   id fedcba9876543210   pose epoch 7", "command   2309737967 failed",
                      "faults    bad_frame 100 now"]:
            self.assertIn(words, text)

    def test_silence_is_said(self):
        with Host() as host:
            code, text = end_of(host.top("--lcm", URL, "--for", "1"))
        self.assertEqual(code, 1)
        self.assertIn(f"nothing heard for 1 s on {URL}: does `stillmap run", text)
        with Host(multicast_by=None) as host:
            code, text = end_of(host.top("--for", "1"))
        self.assertEqual(code, 1)
        self.assertIn("no network of this host has a route", text)

    def test_foreign_messages_are_said(self):
        with Host() as host:
            top = host.top("--lcm", URL)
            top.stdout.readline()
            wrong, named = wrong_datagrams(b"STILLMAP_STATUS", bytes(300), 60)
            send(host, wrong)
            lines = [top.stdout.readline() for _ in range(2)]
            top.send_signal(signal.SIGTERM)
            self.assertEqual(end_of(top)[0], 0)
        self.assertIn(f"{named} messages were none of this version's", lines[1])

    def test_a_wrong_url_is_bad_usage(self):
        done = subprocess.run([STILLMAP, "top", "--lcm", "tcpq://localhost"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("expected udpm://GROUP:PORT", done.stderr)


def read_all(descriptor):
    """Until its other end is closed."""
    text = b""
    while select.select([descriptor], [], [], PATIENCE_S)[0]:
        try:
            piece = os.read(descriptor, 65536)
        except OSError:  # a terminal's way to say that it is over
            break
        if not piece:
            break
        text += piece
    os.close(descriptor)
    return text.decode()


def may_make_networks():
    try:
        with Host():
            pass
    except (OSError, subprocess.CalledProcessError):
        return False
    return True


def names_of(suite):
    for test in suite:
        yield from names_of(test) if isinstance(test, unittest.TestSuite) else [test.id().partition(".")[2]]


def run_all():
    """Each test in a process of its own, several at a time: they wait most of their time. True: all passed."""
    def run_one(name):
        return subprocess.run([sys.executable, *sys.argv[:3], name], capture_output=True, text=True)

    names = list(names_of(unittest.defaultTestLoader.loadTestsFromModule(sys.modules["__main__"])))
    with concurrent.futures.ThreadPoolExecutor(AT_A_TIME) as pool:
        done = list(pool.map(run_one, names))
    for name, one in zip(names, done):
        print("ok    " if one.returncode == 0 else "FAILED", name)
        if one.returncode != 0 or "skipped" in one.stderr:
            print(one.stderr)
    return bool(names) and all(one.returncode == 0 for one in done)


if __name__ == "__main__":
    STILLMAP, PROBE = (str(pathlib.Path(path).resolve()) for path in sys.argv[1:3])
    tools = ["unshare", "nsenter", "ip", "tc", "lcm-logger", "lcm-logplayer"]
    missing = [tool for tool in tools if not shutil.which(tool)]
    if missing:
        sys.exit("not installed: " + " ".join(missing))
    if not may_make_networks():
        if os.geteuid() == 0 or subprocess.run(["unshare", "-rn", "true"], capture_output=True).returncode != 0:
            print("network namespaces are not permitted here")
            sys.exit(77)
        os.execvp("unshare", ["unshare", "-rn", sys.executable, *sys.argv])
    if len(sys.argv) == 3:
        sys.exit(0 if run_all() else 1)
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
