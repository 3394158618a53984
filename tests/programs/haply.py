"""Drives a device through Haply's Inverse Service: inventory, states, force read back, pace, and what a read costs beside a bare round
trip of the same bytes. Nothing but Python. `flotor lend --api haply -- python3 haply.py [SECONDS]`."""

import json
import math
import multiprocessing
import os
import socket
import statistics
import struct
import sys
import time

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
MASK = b"\0\0\0\0"  # changes nothing


def exactly(stream, count):
    data = b""
    while len(data) < count:
        data += stream.recv(count - len(data)) or sys.exit("the service is gone")
    return data


def connect(port):
    stream = socket.create_connection(("127.0.0.1", port))
    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return stream


def receive(stream):
    length = exactly(stream, 2)[1]
    if length == 126:
        (length,) = struct.unpack("!H", exactly(stream, 2))
    return exactly(stream, length)


def frame(message):
    text = json.dumps(message).encode()
    length = bytes([128 | len(text)]) if len(text) < 126 else bytes([128 | 126]) + struct.pack("!H", len(text))
    return b"\x81" + length + MASK + text


def bare(listener, answer):
    """Answers whatever comes with the same bytes."""
    stream, _ = listener.accept()
    stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    while stream.recv(65536):
        stream.sendall(answer)


def median_us(stream, request, count=3000):
    times = []
    for _ in range(count):
        began = time.perf_counter()
        stream.sendall(request)
        receive(stream)
        times.append(time.perf_counter() - began)
    return statistics.median(times) * 1e6


service = connect(10001)
service.sendall(
    b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
)
head = b""
while not head.endswith(b"\r\n\r\n"):
    head += exactly(service, 1)
assert b" 101 " in head, head
first = json.loads(receive(service))
device = first["inverse3"][0]["device_id"]
force = {"x": 0.5, "y": -0.25, "z": 0.3}
push = frame({"inverse3": [{"device_id": device, "commands": {"set_cursor_force": {"vector": force}}}]})
heights, loops, began = [], 0, time.monotonic()
while time.monotonic() - began < SECONDS:
    service.sendall(push)
    state = json.loads(receive(service))["inverse3"][0]["state"]
    heights.append(state["cursor_position"]["z"])
    loops += 1
rate_hz = loops / (time.monotonic() - began)
assert max(heights) - min(heights) > 1e-3, "nobody moves the handle"
assert all(math.isclose(state["current_cursor_force"][axis], force[axis], abs_tol=1e-12) for axis in "xyz"), state

probe = frame({"inverse3": [{"device_id": device, "commands": {"probe_position": {}}}]})
service.sendall(probe)
answer = receive(service)
listener = socket.create_server(("127.0.0.1", 0))
echo = multiprocessing.Process(target=bare, args=(listener, b"\x81\x7e" + struct.pack("!H", len(answer)) + answer), daemon=True)
echo.start()
plain = connect(listener.getsockname()[1])
ratios = [median_us(service, probe) / median_us(plain, probe) for _ in range(3)]
echo.kill()
print(f"ok: {rate_hz:.1f} messages a second; a read is {min(ratios):.2f} of a bare round trip")
assert min(ratios) <= 1.5 or SECONDS < 30.0, ratios
