// The comment lines by which a text table written by write_csv carries what columns cannot say.
//   #ulna rate_hz <number>
//   #ulna channel <column> <role> <axis> <sign> <frame>;<source name>;<source unit>  (; , %
//   escaped) #ulna trial <begin> <end> #ulna segment <begin> <end> <trial> #ulna provenance <text>
#pragma once

#include <string>
#include <vector>

#include "record/mapping.hpp"
#include "record/record.hpp"

namespace ulna {

struct Notes {
  struct ChannelNote {
    std::size_t column = 0;  // of the file; 0 is time
    Channel channel;
  };
  bool present = false;
  double rate_hz = 0.0;
  std::vector<ChannelNote> channels;
  std::vector<Trial> trials;
  std::vector<Segment> segments;
  std::vector<std::string> provenance;
};

// Throws Error kFormat on a line that is none of the above.
Notes parse_notes(const std::vector<std::string>& lines);
std::string format_notes(const Record& record);

// Replaces guesses by what the notes say; the names are the headings'.
void apply_notes(const Notes& notes, const std::vector<Column>& columns, Mapping& mapping);

}  // namespace ulna
