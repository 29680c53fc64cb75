// SPDX-License-Identifier: Apache-2.0
#include "app/report/html.h"

#include <cstddef>
#include <cstdint>

#include <fmt/format.h>

namespace kinescope::report {
namespace {

/// Length of the valid UTF-8 sequence at `at` (RFC 3629), 0 where there is none.
std::size_t sequence_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) -> unsigned {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned first = byte(at);
  if (first < 0x80U) return 1;
  const std::size_t length = first >= 0xF0U ? 4 : first >= 0xE0U ? 3 : 2;
  if (first < 0xC2U || first > 0xF4U) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80U) return 0;
  }
  const unsigned second = byte(at + 1);
  const bool overlong = (first == 0xE0U && second < 0xA0U) || (first == 0xF0U && second < 0x90U);
  const bool surrogate = first == 0xEDU && second > 0x9FU;
  const bool beyond = first == 0xF4U && second > 0x8FU;
  return overlong || surrogate || beyond ? 0 : length;
}

std::string key_attributes(const std::string& pointer, Quantity quantity) {
  return fmt::format(" data-key=\"{}\" data-unit=\"{}\"", escaped(pointer),
                     display_unit(quantity).text);
}

}  // namespace

std::string clean_text(std::string_view text) {
  std::string clean;
  clean.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = sequence_length(text, i);
    if (length == 0) {
      clean += "\xEF\xBF\xBD";
      ++i;
      continue;
    }
    const auto byte = static_cast<unsigned char>(text[i]);
    const bool control = byte < 0x20U || byte == 0x7FU;
    if (control) {
      clean += ' ';
    } else {
      clean += text.substr(i, length);
    }
    i += length;
  }
  return clean;
}

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
