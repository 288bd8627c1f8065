// More channels beside those of a record.
#pragma once

#include <string>
#include <vector>

#include "base/types.hpp"
#include "record/record.hpp"

namespace ulna {

// The same rows, trials and segments with `values` (rows x channels) as further channels. Where one
// of them is a force, the forces that the record had get the role other: an analysis by role takes
// the new ones. Throws Error (kArgument) when a name is taken. step: its line of provenance.
Record append_channels(const Record& record, const Matrix& values,
                       const std::vector<Channel>& channels, const std::string& step);

// Channels that a word of the caller stands for, as Record::resolve, or exactly those that a list
// with commas names ("a,b" or "a,"). Errors name `argument`.
std::vector<Index> channels_of(const Record& record, const std::string& word, const char* argument);

// The word itself, or where it is empty the first of the usual ones that stands for channels (the
// first of all when none does, so that the message names it).
std::string first_word(const Record& record, const std::string& word,
                       const std::vector<std::string>& usual);

// Throws Error (kData) unless every channel has the SI unit; `advice` ends the sentence.
void require_unit(const Record& record, const std::vector<Index>& channels, const std::string& unit,
                  const std::string& advice);

}  // namespace ulna
