// From the columns of a file to channels: by the rules a user gives, or by the names labs use.
//
// Sign convention of every record: positions in the frame of the log; forces and torques are those
// of the human on the robot (F_h). A log that holds the force of the robot on the human is turned
// by a rule with sign = -1.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "record/record.hpp"

namespace ulna {

struct ChannelRule {
  std::string source;  // column of the file, with or without its unit
  std::string name;    // "": from the source
  std::string unit;   // of the file, when its heading does not say or says it wrongly; "": as found
  int sign = 1;       // +1 or -1
  std::string frame;  // ""
  std::optional<Role> role;  // none: from the name
  std::optional<int> axis;   // 0-based; none: from the name, else by order
};

struct MappingRules {
  std::string time_column;  // "": by name, unless rate_hz is given
  std::string time_unit;    // "": as found
  double rate_hz = 0.0;     // 0: from a time column
  std::vector<ChannelRule> channels;
};

// What a file says of one column.
struct Column {
  std::string heading;  // as written
  std::string stem;     // without its unit
  std::string unit;     // as written, or ""
};

struct Mapping {
  Index time = -1;              // column of the clock; -1: none, rate_hz rules
  double time_factor = 1.0;     // to seconds
  std::vector<Index> columns;   // column of every channel
  std::vector<double> factors;  // to SI, sign included
  std::vector<Channel> channels;
  std::vector<Finding> findings;
};

// Refuses a rule whose column does not exist (with the nearest name) or whose unit is unknown.
// Columns that no rule names are kept with the role kOther: nothing recorded is lost.
Mapping map_columns(const std::vector<Column>& columns, const MappingRules& rules);

// Column headings in one line, for messages; at most about 400 characters.
std::string list_of(const std::vector<Column>& columns);

}  // namespace ulna
