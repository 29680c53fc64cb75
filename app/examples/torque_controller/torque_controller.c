/* SPDX-License-Identifier: Apache-2.0
 *
 * torque_controller.cpp in C. */
#include <stdio.h>

#include "dynamics/control/kinescope_torque.h"

enum { MOST_JOINTS = 32 };

int main(int argc, char** argv) {
  double motion[3 * MOST_JOINTS];
  double torque[MOST_JOINTS];
  double half_width[MOST_JOINTS];
  char error[300];
  if (argc != 2) {
    fprintf(stderr, "usage: torque_controller_c MODEL.json\n");
    return 2;
  }
  kinescope_torque_model* model = kinescope_torque_load(argv[1], error, sizeof error);
  if (!model || kinescope_torque_joints(model) > MOST_JOINTS) {
    fprintf(stderr, "torque_controller_c: %s\n", model ? "too many joints" : error);
    return 3;
  }
  const size_t n = kinescope_torque_joints(model);
  size_t have = 0;
  while (scanf("%lf", &motion[have]) == 1) {
    if (++have < 3 * n) continue;
    have = 0;
    const int status = kinescope_torque_mean_and_band(model, motion, motion + n, motion + 2 * n,
                                                      torque, half_width, 90);
    if (status != KINESCOPE_TORQUE_DONE) return 1; /* a robot would stop */
    for (size_t j = 0; j < n; ++j) printf("%.17g ", torque[j]);
    for (size_t j = 0; j < n; ++j) printf("%.17g ", half_width[j]);
    printf("\n");
  }
  kinescope_torque_free(model);
  return 0;
}
