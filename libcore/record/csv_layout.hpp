// What kind of table a text is, found from its beginning: delimiter, decimal sign, comments,
// heading.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "record/csv.hpp"

namespace ulna {

struct Layout {
  char delimiter = ',';
  char decimal = '.';
  bool header = false;
  bool byte_order_mark = false;
  Index first_data_line = 0;  // 0-based line of the file where numbers begin
  char end_of_line = '\n';
  std::vector<Column> columns;
  std::vector<std::string> notes;  // the record's own comment lines, "#ulna ..." without that word
  Index skipped = 0;               // lines before the heading that belong to no table
};

// head: the beginning of the text, all: whether it is the whole text. Throws Error kFormat.
Layout find_layout(std::string_view head, bool all, const CsvOptions& options);

bool is_comment(std::string_view line) noexcept;

// Cells of a line, trimmed; quoted cells without their quotes ("" inside stands for one).
std::vector<std::string> split_cells(std::string_view line, char delimiter);

// One cell of numbers. Empty cells and the usual words for "nothing" are NaN. False: text.
bool parse_cell(std::string_view cell, char decimal, double& value) noexcept;

}  // namespace ulna
