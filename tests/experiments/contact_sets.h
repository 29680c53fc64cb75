// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace kinescope {

/// ur6_contact (simulated arm with labels): calibrated on log.csv, whose contacts the detector is
/// not told of; judged on log_test.csv and on log.csv.
void contact_on_ur6();

/// ur5_contact (measured sweeps of joint 1 into an obstacle): current predicted by a model learned
/// on the free parts of the other files.
void contact_on_ur5();

/// `kinescope contact` on ur5_contact with nothing but each file: found and invented.
void contact_logs_ur5();

/// The same on measured robots that nothing touched, each trajectory judged by what was learned
/// from another, and from itself. `model`: as --model; empty: the momentum balance.
void contact_logs_free(const char* model = "");

/// ur5_contact by the momentum balance and by a torque model, each file from itself and learned
/// from the free parts of four sweeps; then contact_logs_free() by the torque model.
void contact_logs_model(const char* model);

/// The same on simulated robots that nothing touched, at rest, starting, reversing.
void contact_logs_simulated();

}  // namespace kinescope
