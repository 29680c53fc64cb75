// SPDX-License-Identifier: Apache-2.0
//
// `kinescope contact`: find_contacts() in words.
#include <fmt/format.h>

#include "app/commands/commands.h"
#include "app/torque/find_contacts.h"
#include "app/torque/torque_inputs.h"

namespace kinescope {

ExitCode contact_command(const ContactCommandOptions& options, const Console& console) {
  const ContactSummary summary = find_contacts(options);
  for (const std::string& warning : warnings_of(summary.findings)) console.warn(warning);
  // Of some joints the verdict says it.
  const bool is_known = summary.unfit.size() < summary.joints.size();
  const ExitCode code = is_known ? ExitCode::kDone : ExitCode::kUndetermined;
  if (console.json) {
    console.print(contact_json(summary));
    return code;
  }
  fmt::print("{}\ncontacts  {}\nreport    {}\n", contact_verdict(summary),
             (options.output / "contacts.csv").string(),
             (options.output / "contact.html").string());
  return code;
}

}  // namespace kinescope
