// SPDX-License-Identifier: Apache-2.0
//
// The manual and the completion of a small program with all that is hard to write down.
#include <string>

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include "app/manual/command_page.h"
#include "app/manual/completion.h"
#include "app/manual/man_page.h"
#include "app/manual/python_functions.h"

namespace kinescope {
namespace {

CommandPage small_program() {
  CLI::App app("Shows a robot's parts", "show");
  CLI::App& part = *app.add_subcommand("part", "One part: [its] name");
  part.set_help_flag("-h,--help", "Print this help");
  std::string text;
  int count = 3;
  bool flag = false;
  std::vector<std::string> files;
  part.add_option("ROBOT", text, "The robot")->required()->type_name("FILE");
  part.add_option("-c,--count", count, ".5 is no count; it's a \\ number")
      ->check([](const std::string&) { return std::string(); }, "1 to 9")
      ->capture_default_str()
      ->type_name("N");
  part.add_option("--kind", text, "link or joint")
      ->check([](const std::string&) { return std::string(); }, "", "link joint")
      ->required()
      ->type_name("KIND")
      ->group("What is shown");
  part.add_option("--also", files, "More robots")->type_name("FILE");
  part.add_flag("!--no-names", flag, "Without names");
  part.add_flag("--secret", flag, "For nobody")->group("");
  part.footer("Example:\n  show part robot.urdf --kind link\n\nExit codes:\n  0  done\n  2  not");
  return describe_command(app);
}

TEST(Manual, DescribesWhatHelpSays) {
  const CommandPage program = small_program();
  ASSERT_EQ(program.commands.size(), 1U);
  const CommandPage& part = program.commands.front();
  ASSERT_EQ(part.positionals.size(), 1U);
  EXPECT_EQ(part.positionals[0].names, std::vector<std::string>{"ROBOT"});
  ASSERT_EQ(part.groups.size(), 2U);
  ASSERT_EQ(part.groups[0].options.size(), 4U) << "help, count, also, no-names; not secret";
  const OptionEntry& count = part.groups[0].options[1];
  EXPECT_EQ(count.names, (std::vector<std::string>{"-c", "--count"}));
  EXPECT_EQ(count.argument, "N");
  EXPECT_EQ(count.range, "1 to 9");
  EXPECT_EQ(count.default_value, "3");
  EXPECT_FALSE(count.required || count.several);
  EXPECT_TRUE(part.groups[0].options[2].several);
  EXPECT_EQ(part.groups[0].options[3].names, std::vector<std::string>{"--no-names"});
  EXPECT_EQ(part.groups[0].options[3].argument, "");
  EXPECT_EQ(part.groups[1].title, "What is shown");
  EXPECT_TRUE(part.groups[1].options[0].required);
  EXPECT_EQ(part.groups[1].options[0].words, (std::vector<std::string>{"link", "joint"}));
  ASSERT_EQ(part.footer.size(), 2U);
  EXPECT_EQ(part.footer[0].lines, std::vector<std::string>{"show part robot.urdf --kind link"});
}

TEST(Manual, PageIsSafeForRoff) {
  const CommandPage program = small_program();
  const CommandPage& part = program.commands.front();
  EXPECT_EQ(man_page_name(program, program), "show.1");
  EXPECT_EQ(man_page_name(program, part), "show-part.1");
  const std::string page = man_page(program, part, "1.2");
  EXPECT_NE(page.find("\n\\&.5 is no count; it\\(aqs a \\e number.\n[1 to 9; default: 3]\n"),
            std::string::npos)
      << page;
  EXPECT_NE(page.find("\\fBshow part\\fR [\\fIOPTIONS\\fR] \\fB\\-\\-kind\\fR \\fIKIND\\fR "
                      "\\fIROBOT\\fR\n"),
            std::string::npos)
      << page;
  EXPECT_NE(page.find(".SH EXIT STATUS\n.TP\n\\fB0\\fR\ndone.\n"), std::string::npos) << page;
  EXPECT_EQ(page.find("secret"), std::string::npos);
  EXPECT_EQ(page, man_page(program, part, "1.2"));
}

TEST(Manual, CompletionKnowsWordsAndPaths) {
  const CommandPage program = small_program();
  const std::string bash = bash_completion(program);
  EXPECT_NE(bash.find("--kind) argument=WORD words='link joint' ;;"), std::string::npos) << bash;
  EXPECT_NE(bash.find("--also) argument=FILE ;;"), std::string::npos) << bash;
  EXPECT_NE(bash.find("-c | --count) argument=NONE ;;"), std::string::npos) << bash;
  const std::string zsh = zsh_completion(program);
  EXPECT_TRUE(zsh.starts_with("#compdef show\n"));
  EXPECT_NE(zsh.find("'part:One part\\: \\[its\\] name'"), std::string::npos) << zsh;
  EXPECT_NE(zsh.find("'(-c --count)--count=[.5 is no count; it'\\''s a \\\\ number]:N: '"),
            std::string::npos)
      << zsh;
  EXPECT_NE(zsh.find("'(--kind)--kind=[link or joint]:KIND:(link joint)'"), std::string::npos)
      << zsh;
  EXPECT_NE(zsh.find("'*--also=[More robots]:FILE:_files'"), std::string::npos) << zsh;
}

TEST(Manual, PythonFunctionsHaveOptionsAsArguments) {
  const std::string python = python_functions(small_program());
  EXPECT_NE(python.find("__all__ = [\n    \"part\",\n]\n\n\ndef part(\n    robot: Value,\n    *,\n"
                        "    kind: Value,\n    count: Value | None = None,\n"
                        "    also: Values | None = None,\n    no_names: bool = False,\n"
                        "    progress: Progress | None = None,\n) -> dict[str, Any]:\n"),
            std::string::npos)
      << python;
  EXPECT_NE(python.find("    r\"\"\"One part: [its] name.\n"), std::string::npos) << python;
  EXPECT_NE(python.find("    count: N, 1 to 9, default 3\n"
                        "        .5 is no count; it's a \\ number\n"),
            std::string::npos)
      << python;
  EXPECT_NE(python.find("    kind: link|joint\n"), std::string::npos) << python;
  EXPECT_NE(python.find("        \"part\",\n        [robot],\n        [\n"
                        "            (\"--kind\", kind),\n"),
            std::string::npos)
      << python;
  EXPECT_EQ(python.find("secret"), std::string::npos);
}

}  // namespace
}  // namespace kinescope
