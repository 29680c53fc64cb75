// SPDX-License-Identifier: Apache-2.0
#include "app/io/marker_sheet.h"

#include <cmath>
#include <cstdlib>
#include <regex>
#include <sstream>

#include <gtest/gtest.h>

#include "calib/vision/tag_pattern.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kPaperTolerance = 1e-3;  // mm, of a number with four digits

/// Every object begins where the table says.
void expect_whole(const std::string& pdf) {
  const std::size_t at = pdf.rfind("startxref\n");
  ASSERT_NE(at, std::string::npos);
  std::istringstream table(pdf.substr(std::strtoul(pdf.c_str() + at + 10, nullptr, 10)));
  std::string word;
  int count = 0;
  std::size_t offset = 0;
  std::string line;
  table >> word >> word >> count;
  EXPECT_GT(count, 1);
  std::getline(table, line);
  std::getline(table, line);
  for (int object = 1; object < count; ++object) {
    std::getline(table, line);
    EXPECT_EQ(line.size(), 19U);  // and its end: 20 bytes, as the format asks for
    offset = std::strtoul(line.c_str(), nullptr, 10);
    EXPECT_TRUE(pdf.substr(offset).starts_with(std::to_string(object) + " 0 obj")) << object;
  }
  EXPECT_TRUE(pdf.starts_with("%PDF-"));
  EXPECT_TRUE(pdf.ends_with("%%EOF\n"));
}

// Side in mm and cells of every pattern that a sheet holds.
std::vector<std::pair<double, int>> patterns_in(const std::string& pdf) {
  const std::regex pattern(R"(q ([0-9.]+) 0 0 ([0-9.]+) [0-9.]+ [0-9.]+ cm BI /W (\d+) /H (\d+))");
  std::vector<std::pair<double, int>> out;
  for (std::sregex_iterator it(pdf.begin(), pdf.end(), pattern), end; it != end; ++it) {
    EXPECT_EQ((*it)[1], (*it)[2]);
    EXPECT_EQ((*it)[3], (*it)[4]);
    out.emplace_back(std::stod((*it)[1]), std::stoi((*it)[3]));
  }
  return out;
}

TEST(MarkerSheetTest, MarkersHaveTheirTrueSize) {
  for (const char* family : {"tag36h11", "tagStandard41h12", "DICT_5X5_100"}) {
    const SheetPdf sheet = marker_sheet_pdf({.family = family, .ids = {3, 0, 7}, .size_m = 0.04});
    expect_whole(sheet.bytes);
    const auto patterns = patterns_in(sheet.bytes);
    ASSERT_EQ(patterns.size(), 3U);
    const TagPattern pattern = tag_pattern(family, 3);
    for (const auto& [side, cells] : patterns) {
      EXPECT_EQ(cells, pattern.cells);
      EXPECT_NEAR(side * pattern.edge / pattern.cells, 40.0, kPaperTolerance) << family;
    }
  }
}

TEST(MarkerSheetTest, GoesOnOnTheNextPage) {
  MarkerSheet sheet{.family = "tag36h11", .ids = {}, .size_m = 0.1};
  for (int id = 0; id < 5; ++id) sheet.ids.push_back(id);
  const SheetPdf pdf = marker_sheet_pdf(sheet);
  expect_whole(pdf.bytes);
  EXPECT_EQ(pdf.pages, 5);
  EXPECT_EQ(patterns_in(pdf.bytes).size(), 5U);
  EXPECT_EQ(marker_sheet_pdf(sheet).bytes, pdf.bytes);
}

TEST(MarkerSheetTest, WhatDoesNotFitIsRefusedWithTheLargestThatDoes) {
  for (const Paper paper : {Paper::kA4, Paper::kLetter}) {
    const MarkerSheet large{.family = "tag36h11", .ids = {0}, .size_m = 0.2, .paper = paper};
    try {
      static_cast<void>(marker_sheet_pdf(large));
      FAIL() << "larger than the paper";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadRequest);
      std::smatch most;
      const std::string words = error.what();
      ASSERT_TRUE(std::regex_search(words, most, std::regex("at most ([0-9.]+) m"))) << words;
      MarkerSheet largest = large;
      largest.size_m = std::stod(most[1]);
      EXPECT_EQ(marker_sheet_pdf(largest).pages, 1);
      largest.size_m += 0.002;
      EXPECT_THROW(static_cast<void>(marker_sheet_pdf(largest)), Error);
    }
  }
}

}  // namespace
}  // namespace kinescope
