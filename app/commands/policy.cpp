// SPDX-License-Identifier: Apache-2.0
//
// `kinescope policy`: a policy learned from few trials of a system.
#include <fmt/format.h>

#include "app/commands/policy.h"
#include "app/commands/policy_search.h"

namespace kinescope {

ExitCode policy_command(const PolicyCommandOptions& options, const Console& console) {
  const PolicyRequest request = make_policy_request(options);
  Writer writer{.command = "policy", .products = {}, .inputs = {}, .force = options.force};
  writer.products = policy_products(request.problem.learner.explorations +
                                    request.problem.learner.trials);
  if (!request.inputs.empty()) writer.inputs.emplace_back(options.system);
  const OutputFolder folder(options.output, writer);
  PolicySearch search(request, options, folder);
  search.open(options.force);
  search.run(console);
  if (console.json) {
    fmt::print("{}\n", policy_search_json(search.summary()).dump(2));
    return ExitCode::kDone;
  }
  for (const std::string& finding : policy_findings(search.summary())) fmt::print("{}\n", finding);
  fmt::print("policy  {}\npage    {}\n", folder.file("policy.json").string(),
             folder.file("policy.html").string());
  return ExitCode::kDone;
}

}  // namespace kinescope
