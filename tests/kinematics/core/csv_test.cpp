// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/csv.h"

#include <string>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

template <typename Call>
std::string refusal(Call call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    return error.what();
  }
  return "accepted";
}

std::string parse_refusal(std::string_view text) {
  return refusal([&] { static_cast<void>(parse_csv(text, "a.csv")); });
}

TEST(Csv, ReadsATable) {
  const CsvTable table =
      parse_csv("\xEF\xBB\xBF# a comment\nt, \"x\" ,y\r\n\n1,2,3\r\n# between\n4,,-5e-3", "a.csv");
  EXPECT_EQ(table.header, (std::vector<std::string>{"t", "x", "y"}));
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_EQ(table.lines, (std::vector<std::size_t>{4, 6}));
  EXPECT_EQ(table.number(1, 2), -5e-3);
  EXPECT_FALSE(table.optional_number(1, 1));
  EXPECT_EQ(table.integer(0, 0), 1);
  EXPECT_FALSE(table.column("z"));
  EXPECT_EQ(table.require_column("y"), 2U);
}

TEST(Csv, RefusesWithPlaceAndRemedy) {
  EXPECT_EQ(parse_refusal(""), "a.csv: is empty (record it again)");
  EXPECT_EQ(parse_refusal("\n# only this\n"), "a.csv: is empty (record it again)");
  EXPECT_EQ(parse_refusal("t,x\n"), "a.csv: has a header but no rows (record it again)");
  EXPECT_EQ(parse_refusal("t x\n1 2\n"), "accepted");
  EXPECT_EQ(parse_refusal("t x\n1 2 3\n"),
            "a.csv:1: columns are separated by ' ' (separate them by commas, with a point in "
            "decimal numbers)");
  EXPECT_NE(parse_refusal("t;x\ty\n1;2\t3\n").find("by ';' or by tabs"), std::string::npos);
  EXPECT_EQ(parse_refusal("t,x,x\n1,2,3\n"),
            "a.csv:1: two columns are named 'x' (give every column its own name)");
  EXPECT_EQ(parse_refusal("t,,x\n1,2,3\n"), "a.csv:1: column 2 has no name (name every column)");
  EXPECT_EQ(parse_refusal("t,x,\n1,2,3\n"), "a.csv:1: column 3 has no name (name every column)");
  EXPECT_NE(parse_refusal("t,x\n1,2,,\n").find("4 cells where the header has 2"),
            std::string::npos);
  EXPECT_NE(parse_refusal("1,2\n3,4\n").find("not column names"), std::string::npos);
  EXPECT_EQ(parse_refusal("t,x\n1,2\n\n3\n"),
            "a.csv:4: 1 cells where the header has 2 (is the file cut off, or a comma missing?)");
  EXPECT_NE(parse_refusal(std::string_view("t,x\n1,\0\n", 8)).find("NUL"), std::string::npos);
}

TEST(Csv, ACommaAtTheEndOfALineOpensNoColumn) {
  for (const char* text : {"t,x,\n1,2,\n", "t,x\n1,2,\n", "t,x,\n1,2\n"}) {
    const CsvTable table = parse_csv(text, "a.csv");
    EXPECT_EQ(table.header, (std::vector<std::string>{"t", "x"})) << text;
    EXPECT_EQ(table.rows[0], (std::vector<std::string>{"1", "2"})) << text;
  }
}

TEST(Csv, ReadsSemicolonsTabsAndDecimalCommas) {
  for (const char* text :
       {"t;x y;n\n1.5;-2e-3;a,b\n;4;\n", "t;x y;n\n1,5;-2e-3;a,b\n;4;\n",
        "t\tx y\tn\n1,5\t-2e-3\ta,b\n\t4\t\n", "t;x y;n;\r\n1,5;-2e-3;a,b;\r\n;4;;\r\n"}) {
    const CsvTable table = parse_csv(text, "a.csv");
    EXPECT_EQ(table.header, (std::vector<std::string>{"t", "x y", "n"})) << text;
    ASSERT_EQ(table.rows.size(), 2U) << text;
    EXPECT_EQ(table.number(0, 0), 1.5) << text;
    EXPECT_EQ(table.number(0, 1), -2e-3) << text;
    EXPECT_EQ(table.rows[0][2], "a,b") << text;
    EXPECT_FALSE(table.optional_number(1, 0)) << text;
    EXPECT_EQ(table.number(1, 1), 4.0) << text;
  }
  EXPECT_NE(parse_refusal("1,5;2\n1;2\n").find("not column names"), std::string::npos);
}

TEST(Csv, DecimalCommasBesidePointsAreAmbiguous) {
  EXPECT_EQ(parse_refusal("t;x\n1.5;2\n1.6;1,234\n"),
            "a.csv:3: decimal commas (line 3) beside decimal points (line 2) (write all numbers "
            "with a point, and none with a separator of thousands)");
  // A comma in the header separates the columns, whatever else stands there.
  EXPECT_EQ(parse_csv("t,x;y\n1,2\n", "a.csv").header[1], "x;y");
}

TEST(Csv, LinesMayEndInCarriageReturnsAlone) {
  const CsvTable table = parse_csv("t,x\r1,2\r3,4\r", "a.csv");
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_EQ(table.number(1, 1), 4.0);
  EXPECT_EQ(table.lines[1], 3U);
}

TEST(Csv, SaysThatItIsNoText) {
  for (const char* text : {"\x89PNG\x1a\n1,2\n", "a\x01,a\x01\n1,2\n", "a\x02 b\n1,2\n"}) {
    EXPECT_EQ(parse_refusal(text),
              "a.csv: is a binary file or damaged, not UTF-8 text (export the table as CSV "
              "(UTF-8))");
  }
  EXPECT_EQ(parse_csv("t,Winkel \xB0\n1,2\n", "a.csv").rows.size(), 1U) << "Latin-1 is read";
}

TEST(Csv, AMillionColumnsAreRefusedAtOnce) {
  std::string header = "t";
  std::string names = "t";
  for (std::size_t i = 1; i < 1'000'000; ++i) header += ",c" + std::to_string(i);
  EXPECT_EQ(parse_refusal(header + "\n1,2\n"),
            "a.csv:1: has 1000000 columns, more than 10000 (is this the right file?)");
  for (std::size_t i = 1; i < kMostColumns; ++i) names += ",c" + std::to_string(i);
  EXPECT_NE(parse_refusal(names + "\n1,2\n").find("2 cells where"), std::string::npos);
}

TEST(Csv, SetsRowsOfAnotherLengthAside) {
  const CsvTable table = parse_csv("t,x\n1,2\n3\n4,5,6\n7,8", "a.csv", RaggedRows::kSetAside);
  EXPECT_EQ(table.lines, (std::vector<std::size_t>{2, 5}));
  ASSERT_EQ(table.ragged.size(), 2U);
  EXPECT_EQ(table.ragged[0].line, 3U);
  EXPECT_EQ(table.ragged[1].cells, 3U);
  EXPECT_NE(refusal([] {
              static_cast<void>(parse_csv("t,x\n1\n", "a.csv", RaggedRows::kSetAside));
            }).find("1 cells where the header has 2"),
            std::string::npos);
}

TEST(Csv, ACommentMayBeTheHeader) {
  const CsvTable table = parse_csv("# recorded by hand\n#timestamp [ns],filename\n1,a\n2,b\n", "a");
  EXPECT_EQ(table.header, (std::vector<std::string>{"timestamp [ns]", "filename"}));
  EXPECT_EQ(table.header_line, 2U);
  EXPECT_EQ(table.lines, (std::vector<std::size_t>{3, 4}));
  // Not a comment that only looks like one, nor where there is a header.
  EXPECT_NE(parse_refusal("# first, second, third\n1,2\n3,4\n").find("not column names"),
            std::string::npos);
  EXPECT_EQ(parse_csv("# seconds, rad\nt,x\n1,2\n", "a").header,
            (std::vector<std::string>{"t", "x"}));
}

TEST(Csv, TitlesAboveTheHeaderArePassedOverAndSaid) {
  const CsvTable table = parse_csv(
      "Recorded by ControllerTool "
      "v3\nDate;2026-01-02\nRobot,UR5\nRate,100\n\nt,a,b\n0,1,2\n1,2,3\n",
      "log.csv");
  EXPECT_EQ(table.header, (std::vector<std::string>{"t", "a", "b"}));
  EXPECT_EQ(table.header_line, 6U);
  EXPECT_EQ(table.lines, (std::vector<std::size_t>{7, 8}));
  EXPECT_EQ(title_words(table), (std::vector<std::string>{
                                    "log.csv: 4 lines above the header in line 6 are passed over: "
                                    "'Recorded by ControllerTool v3', .."}));
  EXPECT_EQ(title_words(parse_csv("Export from X\nt a\n0 1\n", "log.csv")),
            (std::vector<std::string>{
                "log.csv: a line above the header in line 2 is passed over: 'Export from X'"}));
  // A header with its units below is none of them, nor is one above a damaged row.
  EXPECT_TRUE(parse_csv("t,a\ns,rad\n0,1\n1,2\n", "log.csv").titles.empty());
  EXPECT_TRUE(parse_csv("t,a\n0,1,5\n1,2\n", "log.csv", RaggedRows::kSetAside).titles.empty());
}

TEST(Csv, NamesTheLineOfAHeaderBelowComments) {
  EXPECT_EQ(parse_refusal("# made by a logger\n\nt,x,x\n1,2,3\n"),
            "a.csv:3: two columns are named 'x' (give every column its own name)");
}

TEST(Csv, NumbersAreFinite) {
  for (const std::string cell : {"nan", "inf", "-inf", "1,5", "1.5x", "x", "", "1e999", "0x10"}) {
    const std::string text = "t,x\n1," + (cell == "1,5" ? std::string("1 5") : cell) + "\n";
    const CsvTable table = parse_csv(text, "a.csv");
    const std::string message = refusal([&] { static_cast<void>(table.number(0, 1)); });
    EXPECT_TRUE(message.starts_with("a.csv:2: column 'x' holds '")) << cell << ": " << message;
  }
  const CsvTable table = parse_csv("t,x\n1,1.5\n", "a.csv");
  EXPECT_NE(refusal([&] { static_cast<void>(table.integer(0, 1)); }), "accepted");
  EXPECT_EQ(refusal([&] { static_cast<void>(table.require_column("q")); }),
            "a.csv:1: no column 'q' (name the one that holds it so; the columns are t, x)");
}

TEST(Csv, ParsesNumbersWhole) {
  EXPECT_EQ(parse_number(" +1.5 "), 1.5);
  EXPECT_EQ(parse_number("-2e-3"), -2e-3);
  EXPECT_EQ(parse_number("1.5.2"), std::nullopt);
  EXPECT_EQ(parse_number("+-1"), std::nullopt);
  EXPECT_EQ(parse_number(""), std::nullopt);
}

}  // namespace
}  // namespace kinescope
