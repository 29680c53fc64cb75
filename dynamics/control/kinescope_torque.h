/* SPDX-License-Identifier: Apache-2.0
 *
 * torque_evaluator.h for C: a torque model of `kinescope dynamics --save-model` in a controller.
 * q in rad or m; arrays have one entry a joint. Loading allocates; evaluation does not, takes no
 * lock, and uses the model's own memory: one model a thread. */
#ifndef DYNAMICS_CONTROL_KINESCOPE_TORQUE_H
#define DYNAMICS_CONTROL_KINESCOPE_TORQUE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Names and typedefs are those of C. */
/* NOLINTBEGIN(modernize-use-using,readability-identifier-naming) */

typedef struct kinescope_torque_model kinescope_torque_model;

enum {
  KINESCOPE_TORQUE_DONE = 0,
  KINESCOPE_TORQUE_BAD_ARGUMENT = 1, /* a null pointer, or a band of another percentage */
  KINESCOPE_TORQUE_NOT_FINITE = 2    /* in the sample, or a torque that overflows */
};

/* NULL where it fails, with one line in `error`: ended by 0, cut to error_size bytes; `error` may
 * be NULL where error_size is 0. */
kinescope_torque_model* kinescope_torque_load(const char* path, char* error, size_t error_size);
/* NULL: nothing. */
void kinescope_torque_free(kinescope_torque_model* model);

size_t kinescope_torque_joints(const kinescope_torque_model* model);
/* Valid until the model is freed; NULL beyond the last. */
const char* kinescope_torque_joint_name(const kinescope_torque_model* model, size_t joint);
/* "Nm" or "A". Valid until the model is freed. */
const char* kinescope_torque_unit(const kinescope_torque_model* model);
/* 1: the file holds effects with a memory, which these torques lack; else 0. */
int kinescope_torque_traced(const kinescope_torque_model* model);

/* What is not KINESCOPE_TORQUE_DONE leaves the outputs as they were. */
int kinescope_torque_mean(kinescope_torque_model* model, const double* q, const double* dq,
                          const double* ddq, double* torque);
/* Half-width of the band of `percent` (90 or 95): infinite where the model knows nothing. */
int kinescope_torque_mean_and_band(kinescope_torque_model* model, const double* q, const double* dq,
                                   const double* ddq, double* torque, double* half_width,
                                   int percent);

/* NOLINTEND(modernize-use-using,readability-identifier-naming) */

#ifdef __cplusplus
}
#endif

#endif
