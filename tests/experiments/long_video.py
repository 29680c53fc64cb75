#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Time and memory of `kinescope run` over the length of the video (needs apt's ffmpeg).

  python3 tests/experiments/long_video.py PROGRAM [RECORDING] [MINUTES ..]

Plays a recording forwards and backwards over and over, with its joint log, and runs the whole
command on 1, 4, 15 and 60 minutes of it. A recording with a clock offset has it taken out first:
backwards it would have the other sign.
"""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def run(program, folder):
    """Exit code, wall and processor seconds, peak memory in MB."""
    begin = time.monotonic()
    with open(folder / "printed.txt", "w") as printed:
        child = subprocess.Popen(
            [program, "run", folder, "--output", folder / "run", "--quiet"], stdout=printed, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(child.pid, 0)
    return (os.waitstatus_to_exitcode(status), time.monotonic() - begin, usage.ru_utime + usage.ru_stime,
            usage.ru_maxrss / 1024)


def ffmpeg(*arguments):
    subprocess.run(["ffmpeg", "-v", "error", "-y", *map(str, arguments)], check=True)


def probe(video, what):
    out = subprocess.run(["ffprobe", "-v", "error", "-count_packets", "-select_streams", "v", "-show_entries", f"stream={what}",
                          "-of", "csv=p=0", video], check=True, capture_output=True, text=True).stdout
    return out.strip().strip(",")


def joint_rows(file, offset_s, last_s):
    """Header, and the rows of one pass forwards, in frame time."""
    header, *lines = file.read_text().split()
    rows = []
    for line in lines:
        t, values = line.split(",", 1)
        if 0 <= float(t) - offset_s <= last_s:
            rows.append((float(t) - offset_s, values))
    return header, rows


def make(recording, folder, loop, rows, header, frames, fps, minutes):
    """A recording of that many minutes; the number of its frames."""
    folder.mkdir()
    times = max(1, round(minutes * 60 * fps / (2 * frames)))
    ffmpeg("-stream_loop", times - 1, "-i", loop, "-c", "copy", folder / "video.mp4")
    for name in ("camera.yaml", "tags.yaml"):
        if (recording / name).exists():
            shutil.copy(recording / name, folder)
    mirror_s = (2 * frames - 1) / fps
    with open(folder / "joints.csv", "w") as out:
        print(header, file=out)
        for k in range(times):
            begin_s = k * 2 * frames / fps
            for t, values in rows:
                print(f"{begin_s + t:.6f},{values}", file=out)
            for t, values in reversed(rows):
                print(f"{begin_s + mirror_s - t:.6f},{values}", file=out)
    return int(probe(folder / "video.mp4", "nb_read_packets"))


def main():
    program = Path(sys.argv[1]).resolve()
    recording = Path(sys.argv[2] if len(sys.argv) > 2 else "sample_videos/scara4_none").resolve()
    lengths = [float(minutes) for minutes in sys.argv[3:]] or [1, 4, 15, 60]
    with tempfile.TemporaryDirectory() as temporary:
        temporary = Path(temporary)
        short = temporary / "short"
        shutil.copytree(recording, short)
        if run(program, short)[0] != 0:
            sys.exit((short / "printed.txt").read_text())
        offset_s = json.loads((short / "run/calibration.json").read_text())["time_offset_s"]
        frames = int(probe(short / "video.mp4", "nb_read_packets"))
        over, under = map(int, probe(short / "video.mp4", "r_frame_rate").split("/"))
        fps = over / under
        loop = temporary / "loop.mp4"
        ffmpeg("-i", short / "video.mp4", "-filter_complex", "[0]split[a][b];[b]reverse[c];[a][c]concat", "-c:v", "libx264",
               "-crf", 12, "-preset", "veryfast", "-bf", 0, loop)
        header, rows = joint_rows(short / "joints.csv", offset_s, (frames - 1) / fps)
        print(f"{'minutes':>8} {'frames':>8} {'exit':>4} {'s':>8} {'CPU s':>8} {'ms/frame':>8} {'MB':>7} {'kB/frame':>8} {'px':>7}")
        before = None
        for minutes in lengths:
            folder = temporary / f"{minutes:g}"
            count = make(recording, folder, loop, rows, header, frames, fps, minutes)
            code, wall_s, cpu_s, peak_mb = run(program, folder)
            grown = f"{1024 * (peak_mb - before[1]) / (count - before[0]):8.2f}" if before else f"{'':8}"
            before = (count, peak_mb)
            error = json.loads((folder / "run/calibration.json").read_text())["held_out_rms"] if code == 0 else float("nan")
            print(f"{minutes:8g} {count:8d} {code:4d} {wall_s:8.1f} {cpu_s:8.1f} {1000 * cpu_s / count:8.2f} {peak_mb:7.0f} {grown} "
                  f"{error:7.4f}", flush=True)
            if code != 0:
                print((folder / "printed.txt").read_text(), file=sys.stderr)
            shutil.rmtree(folder)


main()
