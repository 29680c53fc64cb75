// SPDX-License-Identifier: Apache-2.0
//
// What a reader takes from an experiment's products: tables by their cells, medians by where the
// page's drawings have them.
#pragma once

#include <cmath>
#include <cstdlib>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace kinescope {

using CsvRows = std::vector<std::map<std::string, std::string>>;

/// Cells by the names of their columns; no cell holds a comma.
inline CsvRows read_csv_rows(const std::string& text) {
  const auto cells = [](const std::string& line) {
    std::vector<std::string> out;
    std::string cell;
    std::istringstream in(line);
    while (std::getline(in, cell, ',')) out.push_back(cell);
    if (line.ends_with(',')) out.emplace_back();
    return out;
  };
  std::istringstream in(text);
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> names = cells(line);
  CsvRows out;
  while (std::getline(in, line)) {
    const std::vector<std::string> values = cells(line);
    out.emplace_back();
    for (std::size_t c = 0; c < names.size() && c < values.size(); ++c) {
      out.back()[names[c]] = values[c];
    }
  }
  return out;
}

/// The drawing with this name, from <svg to its end.
inline std::string drawing(const std::string& page, const std::string& name) {
  const std::size_t label = page.find("aria-label=\"" + name + "\"");
  if (label == std::string::npos) return {};
  const std::size_t begin = page.rfind("<svg", label);
  return page.substr(begin, page.find("</svg></", label) == std::string::npos
                                ? std::string::npos
                                : page.find("</figure>", label) - begin);
}

/// By row name: the number at the line across the row, read off the ticks of the axis.
inline std::map<std::string, double> medians_drawn(const std::string& svg) {
  const auto all = [&](const std::string& pattern) {
    const std::regex form(pattern);
    return std::vector<std::smatch>(std::sregex_iterator(svg.begin(), svg.end(), form),
                                    std::sregex_iterator());
  };
  const auto ticks =
      all("<text class=\"tick\" x=\"([0-9.]+)\" y=\"[0-9.]+\" text-anchor=\"middle\">([^<]+)<");
  const auto names =
      all("<text class=\"tick\" x=\"[0-9.]+\" y=\"([0-9.]+)\" text-anchor=\"end\">([^<]+)<");
  const auto lines = all("<path class=\"line ink\" d=\"M([0-9.]+) ([0-9.]+)L[0-9.]+ ([0-9.]+)\"");
  std::map<std::string, double> out;
  if (ticks.size() < 2) return out;
  const auto number = [](const std::ssub_match& part) { return std::stod(part.str()); };
  const double x0 = number(ticks.front()[1]);
  const double x1 = number(ticks.back()[1]);
  const double v0 = std::log10(number(ticks.front()[2]));
  const double v1 = std::log10(number(ticks.back()[2]));
  for (const std::smatch& line : lines) {
    const double middle = 0.5 * (number(line[2]) + number(line[3]));
    for (const std::smatch& name : names) {
      constexpr double kBaseline = 4.0;  // a row's name stands so far below its middle, px
      if (std::abs(number(name[1]) - kBaseline - middle) > 1.0) continue;
      out[name[2].str()] = std::pow(10.0, v0 + (number(line[1]) - x0) * (v1 - v0) / (x1 - x0));
    }
  }
  return out;
}

}  // namespace kinescope
