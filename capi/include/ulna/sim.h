/* Simulated experiments: an arm or a rig of springs on a robot's handle, the human behind the arm,
 * the robot's controller and its sensors. The result is a record like that of a real experiment.
 *
 * Frame: that of the record; the robot's base stands in it. Sign: forces in the record are those of
 * the human on the robot; a force reference is that of the robot on the human. SI. */
#ifndef ULNA_SIM_H
#define ULNA_SIM_H

#include <ulna/base.h>
#include <ulna/plant.h>
#include <ulna/record.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The robot tracks a position: relaxed loop, Fig. 4.2a of Dyck 2013. @since 0.1 */
#define ULNA_CONTROL_POSITION (0)
/** The robot exerts a force in open loop: rigid loop, Fig. 4.2b. @since 0.1 */
#define ULNA_CONTROL_FORCE (1)

/** Extra channels: a_x, a_y of an accelerometer at the handle. @since 0.1 */
#define ULNA_EXTRA_ACCELERATION (1)
/** Extra channels: joint angles q_1, q_2 and motor torques tau_1, tau_2. @since 0.1 */
#define ULNA_EXTRA_ROBOT (2)
/** Extra channels: x_true, v_x_true, a_x_true, F_x_true, F_x_cns, F_x_tremor and so on, and
 * cocontraction. @since 0.1 */
#define ULNA_EXTRA_TRUTH (4)

/** An arm, M x'' + B x' + K (x - x0) = -F, of n = 1 or 2 axes.
 * @since 0.1 */
typedef struct ulna_sim_arm {
  int64_t struct_size;      /* sizeof(ulna_sim_arm) */
  const ulna_view *m;       /* n x n, kg */
  const ulna_view *b;       /* n x n, N s/m */
  const ulna_view *k;       /* n x n, N/m; not used with springs */
  const ulna_view *x0;      /* n x 1, m; NULL: the centre */
  const ulna_view *springs; /* springs x 4: anchor x, y (m), rate (N/m), rest length (m); NULL */
  double payload_kg;        /* between force sensor and hand */
} ulna_sim_arm;

/** What the human does. Zero bytes mean: nothing.
 * @since 0.1 */
typedef struct ulna_sim_human {
  int64_t struct_size;       /* sizeof(ulna_sim_human) */
  double tremor_n;           /* rms of a stationary force, each axis */
  double tremor_hz;          /* natural frequency of its filter; 0: 2 */
  double tremor_damping;     /* damping ratio of its filter; 0: 0.7 */
  int32_t cns;               /* 1: a voluntary controller holds the hand at the target */
  int32_t reserved;          /* zero */
  double delay_s;            /* reaction time; 0: 0.15 */
  double lag_s;              /* first-order lag of the muscles */
  double stiffness_n_m;      /* gain on the displacement */
  double damping_n_s_m;      /* gain on the velocity */
  double integral_n_m_s;     /* gain on the integral of the displacement, N/(m s) */
  const ulna_view *target;   /* n x 1, m; NULL: the centre */
  double cocontraction;      /* level, 0 to 1 */
  double stiffness_factor;   /* of K at level 1; 0: 1 */
  double damping_factor;     /* of B at level 1; 0: 1 */
  double reaction_speed_m_s; /* a hand this fast co-contracts fully; 0: no reaction */
  double memory_s;           /* of the reaction; 0: 1 */
} ulna_sim_human;

/** How the robot is controlled and where it stands. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_sim_control {
  int64_t struct_size;   /* sizeof(ulna_sim_control) */
  int32_t mode;          /* ULNA_CONTROL_... */
  int32_t hold_axis;     /* force control: axis (1 or 2) held at the centre; 0: none */
  double kp_n_m;         /* Cartesian; 0: 3000; < 0: 0 */
  double kd_n_s_m;       /* Cartesian; 0: 120; < 0: 0 */
  double rate_hz;        /* of the control, raised to a multiple of the record's; 0: 1000 */
  double delay_s;        /* from reading to torque */
  double force_limit_n;  /* of the commanded force; 0: none */
  double base_m[2];      /* base of the robot in the frame of the record */
  double base_angle_rad; /* and how it is turned */
} ulna_sim_control;

/** Errors of the sensors. Zero bytes mean the defaults named here; negative numbers mean none.
 * @since 0.1 */
typedef struct ulna_sim_sensors {
  int64_t struct_size;                 /* sizeof(ulna_sim_sensors) */
  double position_resolution_m;        /* 0: 2e-6 */
  double position_noise_m;             /* rms, white; 0: 2e-6 */
  double force_resolution_n;           /* 0: 1/24 */
  double force_noise_n;                /* rms, white; 0: 1/24 */
  double force_delay_s;                /* how much later the force channel is */
  double acceleration_resolution_m_s2; /* of the accelerometer */
  double acceleration_noise_m_s2;      /* rms, white */
} ulna_sim_sensors;

/** The experiment around it. Zero bytes mean the defaults named here.
 * @since 0.1 */
typedef struct ulna_sim_options {
  int64_t struct_size;     /* sizeof(ulna_sim_options) */
  double rate_hz;          /* of the reference and the record; 0: 1000 */
  double settle_s;         /* at the first row before the record starts; 0: 2; < 0: none */
  const ulna_view *centre; /* n x 1, m: where the reference is 0; required */
  const int64_t *segments; /* 2 * segment_count rows: begin and end of every perturbation */
  int64_t segment_count;   /* 0: one segment of all rows */
  const char *notes;       /* lines of provenance, as that of the design; NULL: none */
  const char *frame;       /* name of the frame for the channels; NULL: none */
  int64_t seed;            /* 0 is a seed */
  int32_t extras;          /* ULNA_EXTRA_... bits */
  int32_t threads;         /* of a batch; 0: one per processor */
} ulna_sim_options;

/** Simulates run number `run` of the seed. reference: rows x n, m relative to the centre or N.
 * Refuses, before the run, a loop that is unstable at rest. human, control, sensors: NULL means
 * their defaults.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sim_run(const ulna_robot *robot, const ulna_sim_arm *arm,
                                  const ulna_sim_human *human, const ulna_sim_control *control,
                                  const ulna_sim_sensors *sensors, const ulna_sim_options *options,
                                  const ulna_view *reference, int64_t run, ulna_token *token,
                                  ulna_record **out_record);

/** Simulates runs 0 to run_count - 1 of the seed, the same as one by one. out_records: run_count
 * places.
 * @thread any
 * @since 0.1 */
ULNA_API ulna_status ulna_sim_batch(const ulna_robot *robot, const ulna_sim_arm *arm,
                                    const ulna_sim_human *human, const ulna_sim_control *control,
                                    const ulna_sim_sensors *sensors,
                                    const ulna_sim_options *options, const ulna_view *reference,
                                    int64_t run_count, ulna_token *token,
                                    ulna_record **out_records);

#ifdef __cplusplus
}
#endif

#endif
