#pragma once

#include <functional>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "tests/output/temporary_folder.h"

namespace rotslam {

/// A parser of files that anybody may have written.
struct FuzzTarget {
  std::string name;  // of its folder in tests/fuzz/corpus
  // Makes the files of `bytes` in a folder that stays the same, and reads them.
  std::function<void(std::string_view bytes, const TemporaryFolder& folder)> read;
};

inline void PrintTo(const FuzzTarget& target, std::ostream* stream) { *stream << target.name; }

/// All targets that are linked in, by name.
std::vector<FuzzTarget>& FuzzTargets();

/// Puts a target into the list before `main` begins.
struct RegisterFuzzTarget {
  RegisterFuzzTarget(std::string name, decltype(FuzzTarget::read) read);
};

/// The files that one input stands for: its parts between lines "%%", as many as asked for; missing
/// ones are empty.
std::vector<std::string> CutIntoFiles(std::string_view bytes, std::size_t count);

/// What becomes of a file of ours, in a form that changes with every version, when it is damaged:
/// each four bytes of `edits` are a place (two bytes, little-endian), what happens there (modulo
/// four: the byte is set, the number of eight bytes is set, the byte is lost, all behind is lost)
/// and a byte to set. No edits leave a good file.
std::string Damaged(std::string file, std::string_view edits);

/// Reads the bytes once. Good input is read, bad input refused by a std::runtime_error, that very
/// class, whose message is one line and names the file: then the answer is nullopt. Else it is what
/// was thrown instead; whatever is worse ends the program.
std::optional<std::string> ComplaintAbout(const FuzzTarget& target, std::string_view bytes);

}  // namespace rotslam
