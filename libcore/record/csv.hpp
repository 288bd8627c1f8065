// Text tables (CSV, TSV, TXT) to records and back. Reading streams: beside the parsed doubles it
// holds one buffer of 1 MiB, so a file larger than memory's third is no trouble.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/token.hpp"
#include "record/mapping.hpp"
#include "record/record.hpp"

namespace ulna {

enum class Header : int { kDetect = 0, kPresent = 1, kAbsent = 2 };

struct CsvOptions {
  char delimiter = 0;   // ',', ';', '\t', '|' or ' ' for runs of blanks; 0: detect
  char decimal = 0;     // '.' or ','; 0: detect
  Index skip_rows = 0;  // lines to pass over before anything else
  Header header = Header::kDetect;
  MappingRules map;
  std::string name;  // of the source, for provenance and messages; "": the file's name
};

// How the text was understood, so that a map can say it again.
struct Source {
  char delimiter = ',';
  char decimal = '.';
  Index skip_rows = 0;
  bool header = false;
  std::string time_column;  // "" when the rate was given
  std::string time_unit;
};

struct ReadResult {
  Record record;
  std::vector<Finding> findings;  // of the reader and of look()
  Source source;
};

// Refuses, with one sentence: files that are empty, binary, without data, with ragged rows, text in
// a cell of numbers, duplicate columns, no clock, or time stamps that repeat or decrease. An
// incomplete last line without an end of line is left out with a warning. Empty and NaN cells
// become NaN.
ReadResult read_csv(const std::string& path, const CsvOptions& options = {},
                    Token* token = nullptr);
ReadResult read_csv_memory(const char* data, std::size_t size, const CsvOptions& options = {},
                           Token* token = nullptr);

// Columns that another reader has found (MATLAB, NPZ, HDF5), through the same mapping and checks.
// headings: one a column of values, with or without units, as in a text table.
ReadResult from_columns(MatrixRef values, const std::vector<std::string>& headings,
                        const CsvOptions& options = {}, Token* token = nullptr);

// Shortest texts that read back to the same bits; roles, frames, trials, segments and provenance go
// into comment lines that read_csv understands.
void write_csv(const Record& record, const std::string& path, Token* token = nullptr);

}  // namespace ulna
