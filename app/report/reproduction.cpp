// SPDX-License-Identifier: Apache-2.0
#include "app/report/reproduction.h"

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/sections.h"

namespace kinescope::report {

std::string reproduction_section(const Reproduction& of) {
  std::string out = section_head("reproduce", "How to reproduce");
  out += "<pre id=\"command\">" + escaped(of.command) + "</pre>\n";
  if (!of.settings.empty()) {
    out += "<dl class=\"verdict\">";
    for (const auto& [name, value] : of.settings)
      out += fmt::format("<dt>{}</dt><dd>{}</dd>", escaped(name), escaped(value));
    out += "</dl>\n";
  }
  out += "<ul>";
  for (const InputFile& input : of.inputs)
    out += fmt::format("<li>{} <code class=\"hash\">{}</code></li>", escaped(input.name),
                       escaped(input.sha256));
  for (const auto& [file, what] : of.products)
    out += fmt::format("<li><code>{}</code>: {}</li>", escaped(file), escaped(what));
  return out + "</ul></section>\n";
}

}  // namespace kinescope::report
