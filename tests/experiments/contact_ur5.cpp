// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/contact_sets.h"

namespace kinescope {
void contact_on_ur5() {}
}  // namespace kinescope
