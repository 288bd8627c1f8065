/* Records: logs of an experiment, recorded or simulated, as channels on one clock.
 *
 * Values are SI. Sign: positions in the frame of the log; forces and torques are those of the human
 * on the robot. Rows and trials count from 0. A record never changes: what alters one returns
 * another. */
#ifndef ULNA_RECORD_H
#define ULNA_RECORD_H

#include <ulna/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Channels with name, unit, frame and sign on one clock, in one or more trials; immutable.
 * @since 0.1 */
typedef struct ulna_record ulna_record;

/** Role of a channel: none in the analysis. In a rule, 0 means "from the name". @since 0.1 */
#define ULNA_ROLE_OTHER (0)
/** Position or angle, m or rad. @since 0.1 */
#define ULNA_ROLE_POSITION (1)
/** Force or torque of the human on the robot, N or Nm. @since 0.1 */
#define ULNA_ROLE_FORCE (2)
/** Commanded position, m or rad: the perturbation. @since 0.1 */
#define ULNA_ROLE_REFERENCE (3)
/** In a rule only: keep the channel aside whatever its name says. @since 0.1 */
#define ULNA_ROLE_NONE (-1)

/** Heading of a text table: found from the text. @since 0.1 */
#define ULNA_HEADER_DETECT (0)
/** The first line names the columns. @since 0.1 */
#define ULNA_HEADER_PRESENT (1)
/** There is no heading; the columns are called c1, c2 and so on. @since 0.1 */
#define ULNA_HEADER_ABSENT (2)

/** A finding that is good to know. @since 0.1 */
#define ULNA_SEVERITY_NOTE (0)
/** A finding to look at before using results. @since 0.1 */
#define ULNA_SEVERITY_WARNING (1)
/** A finding for which an analysis of this channel refuses. @since 0.1 */
#define ULNA_SEVERITY_ERROR (2)

/** What becomes of one column of a file. Zero bytes mean: as the file and the name say.
 * @since 0.1 */
typedef struct ulna_channel_rule {
  char source[128]; /* column of the file, with or without its unit */
  char name[128];   /* of the channel; empty: from the source */
  char unit[32];    /* of the file; empty: as the heading says */
  char frame[64];   /* frame of the values, free text */
  int32_t sign;     /* -1 turns the channel; 0 and 1 leave it */
  int32_t role;     /* ULNA_ROLE_...; 0: from the name */
  int32_t axis;     /* 1-based place within the role; 0: from the name, else by order */
  int32_t reserved; /* zero */
} ulna_channel_rule;

/** How a text table or columns are read. Zero bytes mean: detect.
 * @since 0.1 */
typedef struct ulna_read_options {
  int64_t struct_size;            /* sizeof(ulna_read_options) */
  int64_t skip_rows;              /* lines to pass over at the beginning */
  int32_t delimiter;              /* ',' ';' '\t' '|' or ' ' for runs of blanks */
  int32_t decimal;                /* '.' or ',' */
  int32_t header;                 /* ULNA_HEADER_... */
  int32_t reserved;               /* zero */
  double rate_hz;                 /* sample rate; then no column is taken for the time */
  const char *time_column;        /* NULL: by name */
  const char *time_unit;          /* NULL: as the heading says, else s */
  const char *name;               /* of the source, for provenance; NULL: the file's */
  const ulna_channel_rule *rules; /* rule_count of them; NULL: channels by name */
  int64_t rule_count;             /* columns without a rule keep the role other */
} ulna_read_options;

/** One channel of a record.
 * @since 0.1 */
typedef struct ulna_channel {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_channel) */
  char name[128];        /* as "F_x" */
  char unit[32];         /* SI */
  char frame[64];        /* or empty */
  char source_name[128]; /* column of the file */
  char source_unit[32];  /* unit in the file */
  int32_t sign;          /* +1 or -1, as applied to the source */
  int32_t role;          /* ULNA_ROLE_... */
  int32_t axis;          /* 0-based within the role */
  int32_t reserved;      /* zero */
} ulna_channel;

/** Rows of one uninterrupted recording.
 * @since 0.1 */
typedef struct ulna_trial {
  int64_t begin; /* first row */
  int64_t end;   /* one past the last row */
} ulna_trial;

/** Rows of one trial that an analysis uses.
 * @since 0.1 */
typedef struct ulna_segment {
  int64_t begin; /* first row */
  int64_t end;   /* one past the last row */
  int64_t trial; /* its trial */
} ulna_segment;

/** What a look at the data found.
 * @since 0.1 */
typedef struct ulna_finding {
  int64_t struct_size; /* set by the caller to sizeof(ulna_finding) */
  int64_t row;         /* first row concerned */
  int64_t count;       /* rows concerned */
  int32_t severity;    /* ULNA_SEVERITY_... */
  int32_t reserved;    /* zero */
  char code[32];       /* stable word: "gap", "nan", "jitter", "saturated", "unit", ... */
  char channel[128];   /* empty for the clock */
  char message[512];   /* one sentence: what, where, what to do */
} ulna_finding;

/** Sizes of a record.
 * @since 0.1 */
typedef struct ulna_record_info {
  int64_t struct_size; /* set by the caller to sizeof(ulna_record_info) */
  int64_t rows;        /* samples */
  int64_t channels;    /* columns of values */
  int64_t trials;      /* at least 1 */
  int64_t segments;    /* at least 1 */
  int64_t findings;    /* of the reader and of the look at the data */
  int64_t provenance;  /* lines of provenance */
  double rate_hz;      /* sample rate */
  double duration_s;   /* rows of all trials divided by the rate */
} ulna_record_info;

/** How the source of a record was understood, so that a map can say it again.
 * @since 0.1 */
typedef struct ulna_record_source {
  int64_t struct_size;   /* set by the caller to sizeof(ulna_record_source) */
  int64_t skip_rows;     /* lines passed over on request */
  int32_t delimiter;     /* character; 0 when the source was no text table */
  int32_t decimal;       /* character; 0 when the source was no text table */
  int32_t header;        /* ULNA_HEADER_PRESENT or ULNA_HEADER_ABSENT */
  int32_t reserved;      /* zero */
  char time_column[128]; /* empty: the rate was given */
  char time_unit[32];    /* unit of the time in the source */
} ulna_record_source;

/** What a record is made of.
 * @since 0.1 */
typedef struct ulna_record_parts {
  int64_t struct_size;          /* sizeof(ulna_record_parts) */
  const ulna_view *time;        /* s, rows x 1; NULL: row / rate_hz */
  const ulna_view *values;      /* rows x channels, SI */
  double rate_hz;               /* 0: from the time */
  const ulna_channel *channels; /* one a column */
  int64_t channel_count;        /* columns of values */
  const ulna_trial *trials;     /* in order and apart; NULL: one trial of all rows */
  int64_t trial_count;          /* 0 with NULL */
  const ulna_segment *segments; /* in order, within their trials; NULL: one a trial */
  int64_t segment_count;        /* 0 with NULL */
  const char *provenance;       /* lines separated by line feeds; NULL: none */
} ulna_record_parts;

/** Reads a text table (CSV, TSV, TXT) from a file. Streams: memory is that of the numbers. Refuses
 * with one sentence (ULNA_ERROR_FILE, _FORMAT, _DATA, or _ARGUMENT for options and rules).
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_record_read_csv(const char *path, const ulna_read_options *options,
                                          ulna_token *token, ulna_record **out_record);

/** The same from `size` bytes in memory, which need no terminating zero.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_record_read_csv_memory(const char *data, int64_t size,
                                                 const ulna_read_options *options,
                                                 ulna_token *token, ulna_record **out_record);

/** Columns read by other means through the same mapping and checks. values: rows x columns;
 * headings: one text a column, with or without a unit, as "Fx [N]".
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_record_from_columns(const ulna_view *values, const char *const *headings,
                                              int64_t heading_count,
                                              const ulna_read_options *options, ulna_token *token,
                                              ulna_record **out_record);

/** Makes a record from its parts, copied. Refuses (ULNA_ERROR_DATA) time that is not finite or does
 * not increase within a trial; NaN in values is kept.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_record_new(const ulna_record_parts *parts, ulna_record **out_record);

/** Frees a record; NULL is allowed.
 * @thread exclusive record
 * @since 0.1 */
ULNA_API void ulna_record_free(ulna_record *record);

/** Sizes of a record.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_get_info(const ulna_record *record, ulna_record_info *out_info);

/** How the source was understood.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_get_source(const ulna_record *record,
                                            ulna_record_source *out_source);

/** One channel, 0 <= index < channels.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_get_channel(const ulna_record *record, int64_t index,
                                             ulna_channel *out_channel);

/** One trial, 0 <= index < trials.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_get_trial(const ulna_record *record, int64_t index,
                                           ulna_trial *out_trial);

/** One segment, 0 <= index < segments.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_get_segment(const ulna_record *record, int64_t index,
                                             ulna_segment *out_segment);

/** One finding, 0 <= index < findings.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_get_finding(const ulna_record *record, int64_t index,
                                             ulna_finding *out_finding);

/** Lines of provenance separated by line feeds. capacity 0 with NULL asks for the size.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_provenance(const ulna_record *record, char *out_text,
                                            int64_t capacity, int64_t *out_size);

/** Borrowed window of the values, rows x channels, column after column; valid until the record is
 * freed.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_values(const ulna_record *record, const double **out_data);

/** Borrowed window of the time, s, rows; valid until the record is freed.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_time(const ulna_record *record, const double **out_data);

/** Channels of a role in order of axis. capacity 0 with NULL asks for the count.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_with_role(const ulna_record *record, int32_t role, int64_t *out,
                                           int64_t capacity, int64_t *out_count);

/** Channels that a word stands for: an exact name; "F" for F_x and F_y; "x" for x and y, "x_ref"
 * for x_ref and y_ref; "position", "force", "reference" for the role. capacity 0 asks for the
 * count.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_resolve(const ulna_record *record, const char *word, int64_t *out,
                                         int64_t capacity, int64_t *out_count);

/** The same rows with a trial for every piece of at least min_rows (0: 100) between gaps longer
 * than gap_steps (0: 1.5) steps and missing values.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_split(const ulna_record *record, double gap_steps,
                                       int64_t min_rows, ulna_record **out_record);

/** Rows [begin, end); trials and segments are cut to them.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_select_rows(const ulna_record *record, int64_t begin, int64_t end,
                                             ulna_record **out_record);

/** The trials of these numbers, in the order of the record.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_select_trials(const ulna_record *record, const int64_t *trials,
                                               int64_t count, ulna_record **out_record);

/** One segment for every onset: from before_s before to after_s after it. onsets: s on the record's
 * clock, n x 1.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_with_segments(const ulna_record *record, const ulna_view *onsets,
                                               double before_s, double after_s,
                                               ulna_record **out_record);

/** The trials of several records as one; channels and rates must agree.
 * @thread shared records
 * @since 0.1 */
ULNA_API ulna_status ulna_record_join(const ulna_record *const *records, int64_t count,
                                      ulna_record **out_record);

/** Every trial on an even clock of rate_hz (0: the record's), band-limited; for stamps that jitter.
 * Refuses gaps and missing values with the row (ULNA_ERROR_DATA).
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_regularise(const ulna_record *record, double rate_hz,
                                            ulna_token *token, ulna_record **out_record);

/** Writes a text table that ulna_record_read_csv reads back to the same bits. A file of that name
 * is replaced only by a whole one; a call that fails or is cancelled leaves it.
 * @thread shared record
 * @since 0.1 */
ULNA_API ulna_status ulna_record_write_csv(const ulna_record *record, const char *path,
                                           ulna_token *token);

/** The SI unit of a unit's text, with the factor: value in SI = factor * value. Unknown units are
 * ULNA_ERROR_ARGUMENT, and the message lists the known ones.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_unit_parse(const char *unit, double *out_factor, char *out_text,
                                     int64_t capacity, int64_t *out_size);

#ifdef __cplusplus
}
#endif

#endif
