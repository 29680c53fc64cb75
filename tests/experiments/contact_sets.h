// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace kinescope {

/// ur6_contact (simulated arm with labels): calibrated on log.csv, whose contacts the detector is
/// not told of; judged on log_test.csv and on log.csv.
void contact_on_ur6();

/// ur5_contact (measured sweeps of joint 1 into an obstacle): current predicted by a model learned
/// on the free parts of the other files.
void contact_on_ur5();

/// Constructed worlds: hard and soft contacts, and free motion.
void contact_simulated();

}  // namespace kinescope
