// SPDX-License-Identifier: Apache-2.0
#include "app/report/html.h"

#include <fmt/format.h>

#include "kinematics/core/text.h"

namespace kinescope::report {
namespace {

std::string key_attributes(const std::string& pointer, Quantity quantity) {
  return fmt::format(" data-key=\"{}\" data-unit=\"{}\"", escaped(pointer),
                     display_unit(quantity).text);
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : clean_text(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string with_code(std::string_view text) {
  std::string out;
  bool in_code = false;
  for (std::size_t from = 0;;) {
    const std::size_t tick = text.find('`', from);
    out += escaped(text.substr(from, tick - from));
    if (tick == std::string_view::npos) break;
    in_code = !in_code;
    out += in_code ? "<code>" : "</code>";
    from = tick + 1;
  }
  return in_code ? out + "</code>" : out;
}

std::string folded(std::string section) {
  static constexpr std::string_view kTitleEnd = "</h2>", kEnd = "</section>";
  const std::size_t title = section.find("<h2>");
  const std::size_t title_end = section.find(kTitleEnd, title);
  const std::size_t end = section.rfind(kEnd);
  if (title == std::string::npos || title_end == std::string::npos || end == std::string::npos)
    return section;
  section.insert(end, "</details>");
  section.insert(title_end + kTitleEnd.size(), "</summary>");
  section.insert(title, "<details class=\"fold tests\"><summary>");
  return section;
}

std::string folded_part(std::string_view summary, std::string_view content) {
  if (content.empty()) return "";
  return fmt::format("<details class=\"tests\"><summary>{}</summary>{}</details>\n",
                     escaped(summary), content);
}

std::string paragraph(std::string_view text, std::string_view css_class) {
  if (css_class.empty()) return fmt::format("<p>{}</p>\n", escaped(text));
  return fmt::format("<p class=\"{}\">{}</p>\n", css_class, escaped(text));
}

std::string figure(std::string_view drawing, std::string_view caption, std::string_view css_class) {
  return fmt::format("<figure class=\"{}\">{}<figcaption>{}</figcaption></figure>\n", css_class,
                     drawing, escaped(caption));
}

std::optional<double> number_at(const nlohmann::json& result, const std::string& pointer) {
  const nlohmann::json::json_pointer place(pointer);
  if (!result.contains(place)) return std::nullopt;
  const nlohmann::json& found = result.at(place);
  if (!found.is_number()) return std::nullopt;
  return found.get<double>();
}

std::string inline_number(const nlohmann::json& result, const std::string& pointer,
                          Quantity quantity) {
  const std::optional<double> found = number_at(result, pointer);
  if (!found) return "not known";
  return fmt::format("<span{}>{}</span>", key_attributes(pointer, quantity),
                     text_with_unit(*found, quantity));
}

std::string inline_uncertainty(const nlohmann::json& result, const std::string& pointer,
                               Quantity quantity) {
  const std::string_view unit = display_unit(quantity).text;
  return fmt::format("<span{}>{}{}{}</span>", key_attributes(pointer, quantity),
                     uncertainty_text(number_at(result, pointer), quantity),
                     quantity == Quantity::kAngle ? "" : " ", unit);
}

Table::Table(std::string_view id, std::string_view caption, const nlohmann::json& result)
    : result_(result) {
  head_ = fmt::format("<div class=\"scroll\"><table id=\"{}\"><caption>{}</caption>\n", id,
                      escaped(caption));
}

void Table::header(const std::vector<std::string>& names) {
  head_ += "<thead><tr>";
  for (const std::string& name : names) head_ += "<th scope=\"col\">" + escaped(name) + "</th>";
  head_ += "</tr></thead>\n";
}

void Table::begin_row() {
  body_ += row_open_ ? "</tr>\n<tr>" : "<tr>";
  row_open_ = true;
}

void Table::text(std::string_view content) { body_ += "<td>" + escaped(content) + "</td>"; }

void Table::html(std::string_view content) { body_ += fmt::format("<td>{}</td>", content); }

void Table::number(const std::string& pointer, Quantity quantity) {
  const std::optional<double> found = number_at(result_, pointer);
  if (!found) {
    body_ += "<td class=\"n none\">–</td>";
    return;
  }
  body_ += fmt::format("<td class=\"n\"{}>{}</td>", key_attributes(pointer, quantity),
                       value_text(*found, quantity));
}

void Table::number_with_unit(const std::string& pointer, Quantity quantity) {
  body_ += fmt::format("<td class=\"n\">{}</td>", inline_number(result_, pointer, quantity));
}

void Table::value(const std::string& pointer, const std::string& expanded_pointer,
                  Quantity quantity) {
  const std::optional<double> found = number_at(result_, pointer);
  if (!found) {
    body_ += "<td class=\"n none\">–</td>";
    return;
  }
  body_ += fmt::format("<td class=\"n\"{}>{}</td>", key_attributes(pointer, quantity),
                       rounded_value(*found, number_at(result_, expanded_pointer), quantity));
}

void Table::uncertainty(const std::string& pointer, Quantity quantity, std::string_view absent) {
  const std::optional<double> found = number_at(result_, pointer);
  if (!found) {
    body_ += fmt::format("<td class=\"n none\">{}</td>", absent);
    return;
  }
  body_ += fmt::format("<td class=\"n\"{}>{}</td>", key_attributes(pointer, quantity),
                       uncertainty_text(found, quantity));
}

void Table::uncertainty_with_unit(const std::string& pointer, Quantity quantity,
                                  std::string_view absent) {
  const std::optional<double> found = number_at(result_, pointer);
  if (!found) {
    body_ += fmt::format("<td class=\"n none\">{}</td>", absent);
    return;
  }
  body_ +=
      fmt::format("<td class=\"n\"><span{}>{}</span> {}</td>", key_attributes(pointer, quantity),
                  uncertainty_text(found, quantity), display_unit(quantity).text);
}

std::string Table::str() const {
  return head_ + "<tbody>" + body_ + (row_open_ ? "</tr>" : "") + "</tbody></table></div>\n";
}

}  // namespace kinescope::report
