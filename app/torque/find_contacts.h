// SPDX-License-Identifier: Apache-2.0
//
// Takes   a log with torques, and a robot with masses or a log to learn them from.
// Gives   the contacts in it: `kinescope contact` without its words.
#pragma once

#include "app/report/contact_summary.h"
#include "app/torque/torque_options.h"

namespace kinescope {

/// Writes contacts.csv, contacts.json and contact.html.
[[nodiscard]] ContactSummary find_contacts(const ContactCommandOptions& options);

}  // namespace kinescope
