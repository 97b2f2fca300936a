#include "apps/cli/command_tree.h"

#include <sstream>

namespace rotslam {
namespace {

// CLI11 shows the values that CLI::IsMember allows as part of the type: "TEXT:{a,b}".
std::vector<std::string> ChoicesOf(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t begin = type.find('{');
  const std::size_t end = type.find('}');
  std::vector<std::string> choices;
  if (begin == std::string::npos || end == std::string::npos || end < begin) return choices;
  std::istringstream list(type.substr(begin + 1, end - begin - 1));
  for (std::string choice; std::getline(list, choice, ',');) choices.push_back(choice);
  return choices;
}

OptionDescription Describe(const CLI::Option& option) {
  OptionDescription description;
  if (option.get_positional()) {
    description.names.push_back(option.get_name(true));
  } else {
    for (const std::string& name : option.get_snames()) description.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) description.names.push_back("--" + name);
  }
  description.takes_value = option.get_items_expected_max() > 0;
  description.choices = ChoicesOf(option);
  description.text = option.get_description();
  return description;
}

std::string ExampleOf(const CLI::App& app) {
  const std::string start = "Example: ";
  const std::string footer = app.get_footer();
  return footer.starts_with(start) ? footer.substr(start.size()) : "";
}

std::string Joined(const std::vector<std::string>& words, const std::string& between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

// ---- bash

// The commands below `command`, each under the words that lead to it: "vocabulary/train".
void WriteBashCases(const CommandDescription& command,
                    const std::string& path,
                    std::string& descents,
                    std::string& values,
                    std::string& words) {
  std::vector<std::string> options;
  std::vector<std::string> others;
  for (const CommandDescription& below : command.commands) {
    others.push_back(below.name);
    descents += (descents.empty() ? "" : "|") + ("'" + path + "/" + below.name + "'");
    WriteBashCases(below, path + "/" + below.name, descents, values, words);
  }
  for (const OptionDescription& argument : command.arguments) {
    others.insert(others.end(), argument.choices.begin(), argument.choices.end());
  }
  for (const OptionDescription& option : command.options) {
    options.insert(options.end(), option.names.begin(), option.names.end());
    if (!option.takes_value) continue;
    const std::string start = "    '" + path + " ";
    const std::string end = "') values='" + Joined(option.choices, " ") + "'; takes_value=1 ;;\n";
    for (const std::string& name : option.names) values.append(start).append(name).append(end);
  }
  words += "    '" + path + "') options='" + Joined(options, " ") + "'; words='" +
           Joined(others, " ") + "' ;;\n";
}

// ---- roff

std::string Roff(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else if (c == '\n') {
      escaped += ' ';
    } else {
      escaped += c;
    }
  }
  // At the start of a line these are requests.
  return escaped.starts_with('.') || escaped.starts_with('\'') ? "\\&" + escaped : escaped;
}

std::string RoffItem(const OptionDescription& option) {
  std::vector<std::string> names;
  names.reserve(option.names.size());
  for (const std::string& name : option.names) names.push_back("\\fB" + Roff(name) + "\\fR");
  std::string item = ".TP\n" + Joined(names, ", ");
  const bool is_positional = !option.names.front().starts_with('-');
  if (!option.choices.empty()) {
    item += " " + Roff(Joined(option.choices, "|"));
  } else if (option.takes_value && !is_positional) {
    item += " \\fIvalue\\fR";
  }
  return item + "\n" + Roff(option.text) + "\n";
}

void WriteRoffCommand(const CommandDescription& command,
                      const std::string& path,
                      std::string& page) {
  const std::string name = path + " " + command.name;
  if (!command.commands.empty()) {
    for (const CommandDescription& below : command.commands) WriteRoffCommand(below, name, page);
    return;
  }
  page += ".SS " + Roff(name) + "\n" + Roff(command.text) + ".\n";
  for (const OptionDescription& argument : command.arguments) page += RoffItem(argument);
  for (const OptionDescription& option : command.options) page += RoffItem(option);
  if (!command.example.empty()) {
    page += ".PP\nExample:\n.PP\n.RS\n.nf\n" + Roff(command.example) + "\n.fi\n.RE\n";
  }
}

}  // namespace

CommandDescription DescribeCommands(const CLI::App& app) {
  CommandDescription description;
  description.name = app.get_name();
  description.text = app.get_description();
  description.example = ExampleOf(app);
  for (const CLI::Option* option : app.get_options()) {
    (option->get_positional() ? description.arguments : description.options)
        .push_back(Describe(*option));
  }
  for (const CLI::App* command : app.get_subcommands(nullptr)) {
    description.commands.push_back(DescribeCommands(*command));
  }
  return description;
}

std::string BashCompletion(const CommandDescription& program) {
  std::string descents;
  std::string values;
  std::string words;
  WriteBashCases(program, "", descents, values, words);
  const std::string& name = program.name;
  return "# bash completion for " + name + ", written by `" + name + R"( completion bash`.
_)" + name +
         R"(() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}
  # bash makes a word of the = in --option=value.
  if [[ $current == = ]]; then
    current=
  elif [[ $previous == = ]]; then
    previous=${COMP_WORDS[COMP_CWORD-2]}
  fi
  local command= word
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    case $command/$word in
      )" +
         descents + R"() command=$command/$word ;;
    esac
  done
  local values= takes_value= options= words=
  case "$command $previous" in
)" + values +
         R"(  esac
  case $command in
)" + words +
         R"(  esac
  if [[ -n $takes_value ]]; then
    words=$values
  elif [[ $current == -* ]]; then
    words=$options
  fi
  # Where nothing fits, files do.
  COMPREPLY=($(compgen -W "$words" -- "$current"))
}
complete -o default -F _)" +
         name + " " + name + "\n";
}

std::string ManualPage(const CommandDescription& program, const std::string& version) {
  const std::string name = Roff(program.name);
  const std::size_t colon = program.text.find(": ");
  const std::string purpose = Roff(program.text.substr(colon == std::string::npos ? 0 : colon + 2));
  std::string upper = program.name;
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  std::string page = ".TH " + upper + " 1 \"\" \"" + name + " " + Roff(version) +
                     "\" \"User Commands\"\n.SH NAME\n" + name + " \\- " + purpose +
                     "\n.SH SYNOPSIS\n.B " + name +
                     "\n.I command\n.RI [ argument ]...\n.RI [ option ]...\n.SH DESCRIPTION\n" +
                     "Recovers a camera's path and a sparse map from a calibrated video: "
                     "orientations first, from 2\\-D matches alone, then positions and points.\n"
                     ".SH OPTIONS\n";
  for (const OptionDescription& option : program.options) page += RoffItem(option);
  page += ".SH COMMANDS\n";
  for (const CommandDescription& command : program.commands) {
    WriteRoffCommand(command, program.name, page);
  }
  page +=
      ".SH EXIT STATUS\n"
      ".TP\n.B 0\nAll went well.\n"
      ".TP\n.B 1\nThe input or the machine did not allow it; one line says why.\n"
      ".TP\n.B 2\nThe command line is not one of ours.\n"
      ".TP\n.B 130\nInterrupted (Ctrl\\-C); what there was has been written.\n"
      ".SH ENVIRONMENT\n"
      ".TP\n.B NO_COLOR\nWhen set and not empty, no colours are used.\n";
  return page;
}

}  // namespace rotslam
