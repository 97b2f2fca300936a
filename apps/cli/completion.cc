#include <cstdio>
#include <memory>
#include <string>

#include "apps/cli/command.h"
#include "apps/cli/command_tree.h"
#include "output/tables/summary.h"

namespace rotslam {

void AddCompletionCommand(CLI::App& app, Action& action) {
  const auto shell = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("completion", "Print what makes a shell complete commands");
  command->add_option("shell", *shell, "Shell")->required()->check(CLI::IsMember({"bash"}));
  command->footer("Example: source <(rotslam completion bash)");
  command->callback([shell, &app, &action] {
    action = [&app] {
      std::fputs(BashCompletion(DescribeCommands(app)).c_str(), stdout);
      return 0;
    };
  });
}

void AddManCommand(CLI::App& app, Action& action) {
  CLI::App* command = app.add_subcommand("man", "Print the manual page");
  command->footer("Example: rotslam man | man -l -");
  command->callback([&app, &action] {
    action = [&app] {
      std::fputs(ManualPage(DescribeCommands(app), Version()).c_str(), stdout);
      return 0;
    };
  });
}

}  // namespace rotslam
