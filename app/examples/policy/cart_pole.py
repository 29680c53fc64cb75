#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
#
# One rollout of a cart-pole for `kinescope policy cart_pole.yaml`. In place of the simulation stands
# whatever moves a robot: read its state, write it, read an input, apply it, wait for the next step.
#
# On standard input: the names of the inputs, then a row of inputs for every state but the last.
# On standard output: the names of the states, then a row of states at once and after every input.
import argparse
import math
import random
import sys

STEP = 0.05
SUBSTEPS = 20
CART, POLE, LENGTH, FRICTION, GRAVITY = 0.5, 0.5, 0.5, 0.1, 9.81


def derivative(state, force):
    _, angle, speed, turn = state
    half = 0.5 * POLE * LENGTH
    sine, cosine = math.sin(angle), math.cos(angle)
    a, b, d = CART + POLE, half * cosine, POLE * LENGTH * LENGTH / 3.0
    push = force - FRICTION * speed + half * sine * turn * turn
    pull = -half * GRAVITY * sine
    det = a * d - b * b
    return [speed, turn, (d * push - b * pull) / det, (a * pull - b * push) / det]


def moved(state, force):
    h = STEP / SUBSTEPS
    for _ in range(SUBSTEPS):
        k1 = derivative(state, force)
        k2 = derivative([x + 0.5 * h * k for x, k in zip(state, k1)], force)
        k3 = derivative([x + 0.5 * h * k for x, k in zip(state, k2)], force)
        k4 = derivative([x + h * k for x, k in zip(state, k3)], force)
        state = [x + h / 6.0 * (p + 2.0 * q + 2.0 * r + s)
                 for x, p, q, r, s in zip(state, k1, k2, k3, k4)]
    return state


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--steps", type=int, required=True)
    options.add_argument("--trial", type=int, required=True)
    options.add_argument("--seed", type=int, required=True)
    chosen = options.parse_args()
    noise = random.Random(f"{chosen.seed} {chosen.trial}")
    state = [noise.gauss(0.0, 0.01) for _ in range(4)]

    if sys.stdin.readline().strip() != "force":
        sys.exit("the inputs are not this cart's")
    print("cart,pole,cart_speed,pole_speed", flush=True)
    for step in range(chosen.steps + 1):
        print(",".join(f"{x + noise.gauss(0.0, 0.01):.9g}" for x in state), flush=True)
        if step == chosen.steps:
            break
        row = sys.stdin.readline()
        if not row:
            break  # stop the motors here
        state = moved(state, float(row))


main()
