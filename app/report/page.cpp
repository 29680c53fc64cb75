// SPDX-License-Identifier: Apache-2.0
#include "app/report/page.h"

#include <fmt/format.h>

#include "app/report/assets.h"
#include "app/report/html.h"

namespace kinescope::report {

std::string page_begin(std::string_view brand, std::string_view title, std::string_view note,
                       std::string_view version, std::span<const ContentsEntry> contents,
                       std::string_view policy) {
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      // Nothing may be loaded from anywhere: the page is complete in itself.
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src "
      "'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:{}\">\n"
      "<meta name=\"generator\" content=\"Kinescope {}\">\n<title>{}: {}</title>\n"
      "<style>\n{}</style>\n</head>\n<body>\n",
      escaped(policy), escaped(version), escaped(title), escaped(brand), page_style());
  out += fmt::format(
      "<header><p class=\"brand\">Kinescope {}</p><h1>{}</h1><p class=\"note\">{} · version "
      "{}</p></header>\n<nav aria-label=\"Contents\"><ol>",
      escaped(brand), escaped(title), escaped(note), escaped(version));
  for (const auto& [id, name] : contents) {
    out += fmt::format("<li><a href=\"#{}\">{}</a></li>", id, name);
  }
  return out + "</ol></nav>\n";
}

}  // namespace kinescope::report
