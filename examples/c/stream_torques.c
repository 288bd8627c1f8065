/* Joint torques of a person with their standard deviations, frame by frame as the sensors of a suit
 * and two shoes send them:
 *
 *     stream_torques [height in m] [mass in kg]
 *
 * The person is simulated, so that the truth is known: standing, arms and trunk moving. One frame
 * of the suit in twenty is lost, and once half a second of them; the shoes have a line of their
 * own. A lost frame is bridged: its angles are carried on from the last ones, its readings are
 * missing (NaN), and the standard deviations grow to what is known of such movements beforehand. A
 * gap longer than kLongestGap is not bridged. After the set-up nothing is allocated.
 *
 * Exit codes: 2 what was given is wrong, 4 a defect of ulna. Built like assess.c.
 */
#define _POSIX_C_SOURCE 199309L /* clock_gettime */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <ulna/ulna.h>

#include "explain.h"

enum {
  kHz = 60,
  kCycle = 10 * kHz, /* frames of the movement, which is repeated */
  kFrames = 10 * kCycle,
  kLongestGap = 12,
  kTextSize = 4096,
  kMostNames = 80,
  kSuitLinks = 17,
  kHinges = 48,
  kLinks = 49,
  kSensors = kSuitLinks + kHinges + 2,
  kOfSuit = 3 * kSuitLinks + kHinges, /* rows of readings, then those of the shoes */
  kRows = kOfSuit + 2 * 6
};

static const double kTurn = 2.0 * 3.14159265358979323846;
static const double kAccelerometer = 0.1; /* standard deviations: m/s^2 */
static const double kAcceleration = 0.5;  /* rad/s^2 */
static const double kForce = 2.0;         /* N */
static const double kMoment = 0.5;        /* N m */
static const char *const kFeet[2] = {"RightFoot", "LeftFoot"};
static const char *const kShown[3] = {"jT9T8_roty", "jRightShoulder_rotx", "jRightKnee_roty"};

/* Names of a kind, cut apart in place. */
typedef struct names {
  char text[kTextSize];
  const char *item[kMostNames];
  int count;
} names;

/* One cycle of the movement: what happens, and what sensors without noise would read. */
typedef struct movement {
  double angle[kCycle][kHinges], rate[kCycle][kHinges], acceleration[kCycle][kHinges];
  double external[kCycle][6 * kLinks];
  double readings[kCycle][kRows];
  double torque[kCycle][kHinges + 6]; /* the truth, and what is missing at the base */
} movement;

typedef struct person {
  ulna_body *body;
  ulna_sensors *sensors;
  names links, hinges, carried, suit; /* carried: the hinge of every link */
} person;

/* What was counted. */
typedef struct tally {
  int lost, bridged;
  int inside[2], compared[2]; /* joints of frames that were there, and of bridged ones */
  double wider; /* largest standard deviation of a bridged frame over that of the frame before */
  double micros[kFrames];
} tally;

static int cut(names *out) {
  char *at = out->text;
  for (out->count = 0; out->count < kMostNames; ++out->count) {
    char *end = strchr(at, '\n');
    out->item[out->count] = at;
    if (end == NULL) return ++out->count;
    *end = '\0';
    at = end + 1;
  }
  return out->count;
}

static int find(const names *all, const char *name) {
  int i = 0;
  while (i < all->count && strcmp(all->item[i], name) != 0) ++i;
  return i;
}

static ulna_view view_of(const double *values, int64_t rows, int64_t columns) {
  ulna_view view = {0};
  view.data = values;
  view.rows = rows;
  view.cols = columns;
  view.row_stride = columns;
  view.col_stride = 1;
  return view;
}

static int read_names(person *p) {
  int64_t size = 0;
  if (ulna_body_names(p->body, ULNA_BODY_LINK_NAMES, p->links.text, kTextSize, &size) != ULNA_OK ||
      ulna_body_names(p->body, ULNA_BODY_JOINT_NAMES, p->hinges.text, kTextSize, &size) !=
          ULNA_OK ||
      ulna_body_names(p->body, ULNA_BODY_LINK_JOINTS, p->carried.text, kTextSize, &size) !=
          ULNA_OK ||
      ulna_human_names(ULNA_HUMAN_SUIT, p->suit.text, kTextSize, &size) != ULNA_OK)
    return explain("stream_torques");
  cut(&p->links);
  cut(&p->hinges);
  cut(&p->carried);
  cut(&p->suit);
  return kOk;
}

/* One row of the table of sensors: at a link's origin, along its axes. */
static void describe(double *row, double kind, int link, double first, double second) {
  int i;
  for (i = 0; i < ULNA_SENSOR_VALUES; ++i) row[i] = i < 15 ? 0.0 : (double)NAN;
  row[0] = kind;
  row[1] = link;
  row[6] = row[10] = row[14] = 1.0;
  row[15] = first;
  row[16] = second;
}

static int put_sensors_on(person *p) {
  double rows[kSensors][ULNA_SENSOR_VALUES];
  const char *name[kSensors];
  ulna_prior_options prior = {0};
  int count = 0;
  int i;
  ulna_view view;
  /* What is known of the movement where the suit is silent: slow, the pelvis almost at rest. */
  prior.struct_size = sizeof prior;
  prior.base_acceleration_m_s2 = 0.3;
  prior.base_angular_acceleration_rad_s2 = 0.3;
  prior.joint_acceleration_rad_s2 = 1.5;
  for (i = 0; i < kSuitLinks; ++i, ++count) {
    name[count] = p->suit.item[i];
    describe(rows[count], ULNA_SENSOR_ACCELEROMETER, find(&p->links, name[count]), kAccelerometer,
             (double)NAN);
  }
  for (i = 0; i < kHinges; ++i, ++count) {
    name[count] = p->hinges.item[i];
    describe(rows[count], ULNA_SENSOR_JOINT_ACCELERATION, find(&p->carried, name[count]),
             kAcceleration, (double)NAN);
  }
  for (i = 0; i < 2; ++i, ++count) {
    name[count] = i == 0 ? "right shoe" : "left shoe";
    describe(rows[count], ULNA_SENSOR_EXTERNAL_WRENCH, find(&p->links, kFeet[i]), kForce, kMoment);
  }
  view = view_of(rows[0], kSensors, ULNA_SENSOR_VALUES);
  return ulna_sensors_new(p->body, &view, name, kSensors, &prior, &p->sensors) == ULNA_OK
             ? kOk
             : explain("stream_torques");
}

/* Every hinge above the hips swings between 0 and its amplitude, with rate and acceleration. */
static void swing(const person *p, movement *m) {
  int i, k;
  for (k = 0; k < kHinges; ++k) {
    const char *name = p->hinges.item[k];
    const int stands = strstr(name, "Hip") || strstr(name, "Knee") || strstr(name, "Ankle") ||
                       strstr(name, "BallFoot");
    const double size = stands ? 0.0 : strstr(name, "Shoulder_") ? 0.5 : 0.15;
    const double omega = kTurn * (1 + k % 4) / 10.0; /* rad/s: whole turns in a cycle */
    for (i = 0; i < kCycle; ++i) {
      const double phase = omega * i / kHz;
      m->angle[i][k] = 0.5 * size * (1.0 - cos(phase));
      m->rate[i][k] = 0.5 * size * omega * sin(phase);
      m->acceleration[i][k] = 0.5 * size * omega * omega * cos(phase);
    }
  }
}

/* Half of what holds the body acts at each foot. The feet lie along the world's axes. */
static int stand(const person *p, const ulna_body_motion *motion, movement *m) {
  static double pose[kCycle][7 * kLinks];
  int64_t count = 0;
  int i, foot, k;
  if (ulna_body_inverse_dynamics(p->body, motion, NULL, m->torque[0],
                                 (int64_t)(sizeof m->torque / sizeof(double)), &count) != ULNA_OK ||
      ulna_body_poses(p->body, motion, pose[0], (int64_t)(sizeof pose / sizeof(double)), &count) !=
          ULNA_OK)
    return explain("stream_torques");
  for (i = 0; i < kCycle; ++i) {
    for (foot = 0; foot < 2; ++foot) {
      const int link = find(&p->links, kFeet[foot]);
      const double *at = pose[i] + 7 * link; /* of the foot's origin; the base is at zero */
      const double *missing = m->torque[i] + kHinges;
      double *wrench = m->external[i] + 6 * link;
      for (k = 0; k < 6; ++k) wrench[k] = 0.5 * missing[k];
      wrench[3] -= at[1] * wrench[2] - at[2] * wrench[1];
      wrench[4] -= at[2] * wrench[0] - at[0] * wrench[2];
      wrench[5] -= at[0] * wrench[1] - at[1] * wrench[0];
    }
  }
  return kOk;
}

/* Torques and readings of the movement. */
static int feel(const person *p, movement *m) {
  static double felt[kCycle][12];
  const double origin[3] = {0.0, 0.0, 0.0};
  const ulna_view place = view_of(origin, 1, 3);
  const ulna_view angle = view_of(m->angle[0], kCycle, kHinges);
  const ulna_view rate = view_of(m->rate[0], kCycle, kHinges);
  const ulna_view acceleration = view_of(m->acceleration[0], kCycle, kHinges);
  const ulna_view external = view_of(m->external[0], kCycle, 6 * kLinks);
  ulna_body_motion motion = {0};
  int64_t count = 0;
  int i, s;
  motion.struct_size = sizeof motion;
  motion.angle = &angle;
  motion.rate = &rate;
  motion.acceleration = &acceleration;
  if (stand(p, &motion, m) != kOk) return kInternal;
  if (ulna_body_inverse_dynamics(p->body, &motion, &external, m->torque[0],
                                 (int64_t)(sizeof m->torque / sizeof(double)), &count) != ULNA_OK)
    return explain("stream_torques");
  for (s = 0; s < kSuitLinks; ++s) {
    if (ulna_body_point(p->body, &motion, p->suit.item[s], &place, felt[0],
                        (int64_t)(sizeof felt / sizeof(double)), &count) != ULNA_OK)
      return explain("stream_torques");
    for (i = 0; i < kCycle; ++i) memcpy(m->readings[i] + 3 * s, felt[i] + 6, 3 * sizeof(double));
  }
  for (i = 0; i < kCycle; ++i) {
    double *row = m->readings[i] + 3 * kSuitLinks;
    memcpy(row, m->acceleration[i], sizeof m->acceleration[i]);
    for (s = 0; s < 2; ++s)
      memcpy(row + kHinges + 6 * s, m->external[i] + 6 * find(&p->links, kFeet[s]),
             6 * sizeof(double));
  }
  return kOk;
}

/* The same numbers on every machine: uniform in (0, 1), and normal by Box and Muller. */
static double uniform(uint32_t *state) {
  *state = 1664525u * *state + 1013904223u;
  return ((double)(*state >> 8) + 0.5) / 16777216.0;
}

static double normal(uint32_t *state) {
  const double radius = sqrt(-2.0 * log(uniform(state)));
  return radius * cos(kTurn * uniform(state));
}

static double deviation_of(int row) {
  const int shoe = row - kOfSuit;
  if (row < 3 * kSuitLinks) return kAccelerometer;
  if (shoe < 0) return kAcceleration;
  return shoe % 6 < 3 ? kForce : kMoment;
}

static double micros_now(void) {
#ifdef _WIN32
  return 1e6 * (double)clock() / CLOCKS_PER_SEC;
#else
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return 1e6 * (double)now.tv_sec + 1e-3 * (double)now.tv_nsec;
#endif
}

static void print_frame(const person *p, int frame, int lost, const double *torque,
                        const double *deviation) {
  size_t i;
  printf("%6.2f s", (double)frame / kHz);
  for (i = 0; i < sizeof kShown / sizeof *kShown; ++i) {
    const int k = find(&p->hinges, kShown[i]);
    printf("  %s %7.2f +- %.2f N m", kShown[i], torque[k], deviation[k]);
  }
  printf("%s\n", lost ? "  (bridged)" : "");
}

static void compare(const double *torque, const double *deviation, const double *truth, int lost,
                    tally *t) {
  int k;
  for (k = 0; k < kHinges; ++k) {
    t->inside[lost] += fabs(torque[k] - truth[k]) < 1.96 * deviation[k];
    ++t->compared[lost];
  }
}

/* All frames through the stream. */
static int run(const person *p, const movement *m, ulna_torque_stream *stream, tally *t) {
  const double base[10] = {0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
  double angle[kHinges], rate[kHinges], measured[kRows], torque[kHinges], deviation[kHinges];
  double usual = 0.0; /* deviation of the last frame that was there */
  uint32_t state = 1u;
  int gap = 0;
  int frame, k;
  for (frame = 0; frame < kFrames; ++frame) {
    const int now = frame % kCycle;
    const int lost = frame > 0 && (uniform(&state) < 0.05 || (frame >= 900 && frame < 930));
    double begin, shoulder;
    gap = lost ? gap + 1 : 0;
    for (k = 0; k < kHinges; ++k) {
      angle[k] = lost ? angle[k] + rate[k] / kHz : m->angle[now][k];
      if (!lost) rate[k] = m->rate[now][k];
    }
    for (k = 0; k < kRows; ++k)
      measured[k] = lost && k < kOfSuit ? (double)NAN
                                        : m->readings[now][k] + deviation_of(k) * normal(&state);
    t->lost += lost;
    if (gap > kLongestGap) {
      t->micros[frame] = 0.0;
      continue;
    }
    begin = micros_now();
    if (ulna_torque_stream_update(stream, base, angle, rate, measured, torque, deviation, NULL) !=
        ULNA_OK)
      return explain("stream_torques");
    t->micros[frame] = micros_now() - begin;
    t->bridged += lost;
    compare(torque, deviation, m->torque[now], lost, t);
    shoulder = deviation[find(&p->hinges, kShown[1])];
    if (lost) t->wider = fmax(t->wider, shoulder / usual);
    if (!lost) usual = shoulder;
    if (frame < kCycle && (frame % kHz == 0 || (lost && t->bridged < 3)))
      print_frame(p, frame, lost, torque, deviation);
  }
  return kOk;
}

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a;
  const double y = *(const double *)b;
  return (x > y) - (x < y);
}

static void print_tally(tally *t) {
  printf("frames   %d, %d lost: %d bridged, %d in a gap too long\n", kFrames, t->lost, t->bridged,
         t->lost - t->bridged);
  printf("bridged  the shoulder's standard deviation grows up to %.0f-fold\n", t->wider);
  printf("truth    within 1.96 standard deviations in %.1f %%, of bridged frames %.1f %%\n",
         100.0 * t->inside[0] / t->compared[0], 100.0 * t->inside[1] / t->compared[1]);
  qsort(t->micros, kFrames, sizeof *t->micros, ascending);
  printf("time     %.0f us a frame, 99.9 %% of frames below %.0f us\n", t->micros[kFrames / 2],
         t->micros[kFrames - kFrames / 1000 - 1]);
}

static int stream(person *p, movement *m, tally *t) {
  ulna_torque_stream *made = NULL;
  int code = read_names(p);
  if (code == kOk) code = put_sensors_on(p);
  if (code != kOk) return code;
  swing(p, m);
  code = feel(p, m);
  if (code != kOk) return code;
  if (ulna_torque_stream_new(p->sensors, NULL, &made) != ULNA_OK) return explain("stream_torques");
  code = run(p, m, made, t);
  ulna_torque_stream_free(made);
  if (code == kOk) print_tally(t);
  return code;
}

static int number(const char *word, const char *what, double *value) {
  char *end = NULL;
  *value = strtod(word, &end);
  if (end != word && *end == '\0' && isfinite(*value)) return kOk;
  fprintf(stderr, "stream_torques: the %s '%s' is no number\n", what, word);
  return kBadInput;
}

int main(int count, char **words) {
  ulna_human_options human = {0};
  person *p = calloc(1, sizeof *p);
  movement *m = calloc(1, sizeof *m);
  tally *t = calloc(1, sizeof *t);
  int code = p != NULL && m != NULL && t != NULL ? kOk : kFailedAnalysis;
  human.struct_size = sizeof human;
  human.height_m = 1.793;
  human.mass_kg = 72.7;
  if (code == kOk && count > 1) code = number(words[1], "height", &human.height_m);
  if (code == kOk && count > 2) code = number(words[2], "mass", &human.mass_kg);
  if (code == kOk && ulna_body_new_human(&human, &p->body) != ULNA_OK)
    code = explain("stream_torques");
  if (code == kOk) code = stream(p, m, t);
  if (p != NULL) {
    ulna_sensors_free(p->sensors);
    ulna_body_free(p->body);
  }
  free(t);
  free(m);
  free(p);
  return code;
}
