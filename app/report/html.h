// SPDX-License-Identifier: Apache-2.0
//
// Text into HTML: escaping, and tables whose numbers come from the result document and say from
// where.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/numbers.h"

namespace kinescope::report {

/// clean_text() with & < > " ' escaped: safe as content and inside a quoted attribute.
[[nodiscard]] std::string escaped(std::string_view text);
/// escaped(), with what stands between backticks as <code>.
[[nodiscard]] std::string with_code(std::string_view text);
/// A section (<section ..><h2>..</h2>..</section>) that opens at its title, without a script;
/// printed in full. Empty stays empty.
[[nodiscard]] std::string folded(std::string section);
/// The content behind one line; nothing where it is empty.
[[nodiscard]] std::string folded_part(std::string_view summary, std::string_view content);
/// <p class="..">text</p>, the text escaped.
[[nodiscard]] std::string paragraph(std::string_view text, std::string_view css_class = "");
/// <figure> with its caption; the drawing is HTML already, the caption is text.
[[nodiscard]] std::string figure(std::string_view drawing, std::string_view caption,
                                 std::string_view css_class = "");

/// A table of the report. Numbers are named by their place in the result document (a JSON pointer),
/// so that the page cannot show what the document does not hold; `data-key` and `data-unit` keep
/// the place.
class Table {
 public:
  Table(std::string_view id, std::string_view caption, const nlohmann::json& result);

  void header(const std::vector<std::string>& names);
  void begin_row();
  void text(std::string_view content);
  void html(std::string_view content);
  void number(const std::string& pointer, Quantity quantity);
  /// The number with its unit, where a column holds several.
  void number_with_unit(const std::string& pointer, Quantity quantity);
  /// The value, rounded to the place of its expanded uncertainty.
  void value(const std::string& pointer, const std::string& expanded_pointer, Quantity quantity);
  /// The expanded uncertainty, two digits; `absent` where the document has none.
  void uncertainty(const std::string& pointer, Quantity quantity,
                   std::string_view absent = "not determined");
  void uncertainty_with_unit(const std::string& pointer, Quantity quantity,
                             std::string_view absent = "not determined");
  [[nodiscard]] std::string str() const;

 private:
  const nlohmann::json& result_;
  std::string head_;
  std::string body_;
  bool row_open_ = false;
};

/// The number at the pointer, or nothing where it is null or missing.
[[nodiscard]] std::optional<double> number_at(const nlohmann::json& result,
                                              const std::string& pointer);
/// A number in running text: <span data-key=..>value unit</span>.
[[nodiscard]] std::string inline_number(const nlohmann::json& result, const std::string& pointer,
                                        Quantity quantity);
/// The same of an expanded uncertainty, two digits.
[[nodiscard]] std::string inline_uncertainty(const nlohmann::json& result,
                                             const std::string& pointer, Quantity quantity);

}  // namespace kinescope::report
