#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""One gradient step of policy search beside the same mathematics in PyTorch (apt: python3-torch).

  python3 tests/experiments/policy_against_torch.py build/test/bench_dynamics_policy [SAMPLES ..]

Both: 400 particles x 60 steps of a cart and a pole, two processes of N samples and six columns,
200 basis functions with dropout, saturating cost; double precision, one thread, CPU milliseconds.
The variance goes through the inverse of the Cholesky factor, which is faster in PyTorch, too.
"""
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import json
import resource
import subprocess
import sys
import time

import torch

PARTICLES, STEPS, BASIS, STEP_S = 400, 60, 200, 0.05
DROPOUT, FORCE = 0.25, 10.0
ROUNDS = 5


class Process:
    """Squared exponential of one speed increment."""

    def __init__(self, samples, draw):
        angle = 6.0 * torch.rand(samples, generator=draw) - 3.0
        inputs = torch.randn(samples, 6, generator=draw)
        inputs[:, 3], inputs[:, 4], inputs[:, 5] = torch.sin(angle), torch.cos(angle), 5.0 * inputs[:, 5]
        self.scales = torch.tensor([1.5, 1.8, 2.1, 2.4, 2.7, 8.0])
        self.inputs = inputs / self.scales
        self.squares = (self.inputs**2).sum(1)
        self.variance = 0.8
        factor = torch.linalg.cholesky(self.kernel(self.inputs) + 0.05 * torch.eye(samples))
        self.inverse = torch.linalg.inv(factor).T.contiguous()
        self.weights = self.inverse @ (self.inverse.T @ (0.5 * torch.randn(samples, generator=draw)))

    def kernel(self, scaled):
        squares = (scaled**2).sum(1, keepdim=True) + self.squares - 2.0 * scaled @ self.inputs.T
        return self.variance * torch.exp(-0.5 * squares)

    def draw(self, inputs, noise):
        rows = self.kernel(inputs / self.scales)
        variance = self.variance - ((rows @ self.inverse) ** 2).sum(1)
        return 0.7 * (rows @ self.weights + torch.sqrt(variance.clamp(min=1e-9)) * noise)


def policy(state, centres, scales, weights, draw):
    seen = torch.stack([state[0], state[2], state[3], torch.sin(state[1]), torch.cos(state[1])], 1)
    seen, centres = seen / scales, centres / scales
    squares = (seen**2).sum(1, keepdim=True) + (centres**2).sum(1) - 2.0 * seen @ centres.T
    kept = (torch.rand(PARTICLES, BASIS, generator=draw) > DROPOUT) / (1.0 - DROPOUT)
    out = (kept * torch.exp(-0.5 * squares)) @ weights
    return FORCE * torch.tanh(out / FORCE)


def gradient(processes, parameters, draw):
    centres, scales, weights = parameters
    state = list(0.3 * torch.randn(4, PARTICLES, generator=draw))
    cost = 0.0
    for _ in range(STEPS):
        cart, pole, cart_speed, pole_speed = state
        force = policy(state, centres, scales, weights, draw)
        inputs = torch.stack([cart, cart_speed, pole_speed, torch.sin(pole), torch.cos(pole), force], 1)
        noise = torch.randn(2, PARTICLES, generator=draw)
        more_cart, more_pole = (process.draw(inputs, one) for process, one in zip(processes, noise))
        state = [cart + STEP_S * (cart_speed + 0.5 * more_cart), pole + STEP_S * (pole_speed + 0.5 * more_pole),
                 cart_speed + more_cart, pole_speed + more_pole]
        away = ((state[0] - 0.2) / 1.0) ** 2 + ((state[1].abs() - 3.1) / 3.0) ** 2
        cost = cost + (1.0 - torch.exp(-away)).mean()
    for parameter in parameters:
        parameter.grad = None
    cost.backward()


def torch_ms(samples):
    draw = torch.Generator().manual_seed(1)
    processes = [Process(samples, draw) for _ in range(2)]
    parameters = [torch.randn(BASIS, 5, generator=draw), torch.linspace(1.0, 2.0, 5), 5.0 * torch.randn(BASIS, generator=draw)]
    for parameter in parameters:
        parameter.requires_grad_(True)
    gradient(processes, parameters, draw)
    begin = time.process_time()
    gradient(processes, parameters, draw)
    return 1000.0 * (time.process_time() - begin)


def own_ms(program, samples):
    out = subprocess.run([program, f"--benchmark_filter=policy_step/se/{samples}/1$", "--benchmark_format=json"],
                         check=True, capture_output=True, text=True).stdout
    return json.loads(out)["benchmarks"][0]["cpu_time"]


def main():
    torch.set_num_threads(1)
    torch.set_default_dtype(torch.float64)
    print(f"{'N':>5} {'own, ms':>8} {'PyTorch, ms':>11} {'ratio (each round)':>20}")
    for samples in [int(word) for word in sys.argv[2:]] or [120, 300]:
        rounds = [(own_ms(sys.argv[1], samples), torch_ms(samples)) for _ in range(ROUNDS)]
        own, other = (sorted(times)[ROUNDS // 2] for times in zip(*rounds))
        ratios = " ".join(f"{b / a:.1f}" for a, b in rounds)
        print(f"{samples:5d} {own:8.1f} {other:11.1f} {ratios:>20}", flush=True)
    print(f"peak memory of this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


main()
