/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * incise_stepper.ko inside: the structs that its files share. The interface for
 * programs is uapi/incise_stepper.h.
 *
 *   page ──▶ motor ──▶ profile ──▶ edges ──▶ lines      a hard timer per motor
 *    └▶ plan ─▶┤                                 │
 *   file ──────┘◀── inputs: limits, e-stop … ◀───┘      hard interrupts
 *     ▲                │
 *     └── events ◀─────┘
 *
 * Locks, outer first: stepper.loading (LOAD_PLAN), stepper.mutex (set-up, owner, unbind),
 * motor.lock (raw; all that moves), plan.lock (raw; stops), events.lock (raw). sync.lock is on
 * its own. No memory of a user is touched under any of them: mmap() comes with the user's
 * memory locked already.
 */
#ifndef INCISE_DRIVER_STEPPER_H
#define INCISE_DRIVER_STEPPER_H

#include <linux/atomic.h>
#include <linux/cdev.h>
#include <linux/device.h>
#include <linux/hrtimer.h>
#include <linux/mutex.h>
#include <linux/notifier.h>
#include <linux/pm_qos.h>
#include <linux/spinlock.h>
#include <linux/wait.h>
#include <linux/workqueue.h>

#include "../lib/fixed/home_edge.h"
#include "../lib/fixed/profile.h"

#include "stepper_page.h"
#include "uapi/incise_stepper.h"

struct dentry;
struct file;
struct fwnode_handle;
struct gpio_desc;
struct platform_device;
struct seq_file;
struct stepper;
struct stepper_plan;
struct task_struct;

/* Bins of a histogram: [0, 1), [1, 2), [2, 4) … µs; the last one is open. */
#define STEPPER_BINS 24

struct stepper_histogram {
	u64 count[STEPPER_BINS];
	u64 sum_ns;
	u64 max_ns;
};

/* Inputs, in the order of the bits INCISE_STEPPER_LINE_… */
enum stepper_input {
	STEPPER_LIMIT_MIN,
	STEPPER_LIMIT_MAX,
	STEPPER_HOME,
	STEPPER_ESTOP,
	STEPPER_DRIVER,
	STEPPER_INPUTS
};

/* Outputs, as the tracepoint names them; the inputs' numbers go before. */
enum stepper_output {
	STEPPER_ENABLE = STEPPER_INPUTS,
	STEPPER_DIR,
	STEPPER_STEP,
	STEPPER_SYNC
};

/* An input's interrupt; irq is 0 if its chip has no interrupts. */
struct stepper_irq {
	struct stepper *stepper;
	int motor; /* -1: of the controller */
	enum stepper_input input;
	int irq;
	/* A storm */
	s64 window_ns; /* its edges since … */
	u32 edges;
	bool masked;
	u64 storms;
};

struct stepper_lines {
	struct gpio_desc *step, *dir, *enable;
	struct gpio_desc *input[STEPPER_INPUTS]; /* NULL: there is none */
	struct stepper_irq irq[STEPPER_INPUTS];
};

/* The next action of the timer. */
enum stepper_next {
	STEPPER_NEXT_PLAN,  /* a tick of the plan that this motor leads */
	STEPPER_NEXT_TICK,  /* read the set-point, run the profile */
	STEPPER_NEXT_DIR,   /* change of direction */
	STEPPER_NEXT_LEAD,  /* leading edge: a step */
	STEPPER_NEXT_TRAIL, /* end of the pulse */
	STEPPER_NEXT_NONE
};

struct stepper_motor {
	struct stepper *stepper;
	unsigned int index;
	struct stepper_lines lines;

	raw_spinlock_t lock; /* all below */
	struct hrtimer timer;
	bool timing; /* the timer is queued, or its callback will queue it */

	struct incise_stepper_config config;
	s64 interval_ns; /* of steps at config.velocity, rounded up */
	s64 lag_ns;	 /* lateness caught up, not put off … */
	s64 catch_ns;	 /* … by at most so much in a step */
	u32 state;
	u32 faults;
	u32 inputs;
	u32 flags;
	int cpu;  /* of the timer, while it has power */
	u32 load; /* of it, see stepper_setup_load() */
	bool powered;
	bool disabling; /* comes to rest to be disabled */
	s64 position;	/* sum of steps, and the origin */
	s64 home_position;
	struct incise_home_edge edge;
	s64 since_ns[STEPPER_INPUTS]; /* of an input that may bounce; 0: as in inputs */
	s64 since_position;	      /* then, of home */
	u64 steps_up, steps_down, late, shifted_ns;
	u64 shifted_then_ns; /* at the begin of a window, see stepper_motor_lag() */
	s64 window_ns;	     /* … which was then */
	u32 lagging;	     /* windows in a row */

	/* Set-point */
	struct stepper_setpoint setpoint; /* in force, with its seq */
	s64 target;			  /* clamped */
	bool asked;			  /* the profile does not know target yet */
	s64 seen_ns;			  /* the last sign of life */

	/* Plan: written without power only, stepper.mutex held too */
	struct stepper_plan *plan; /* NULL: there is none */
	unsigned int axis;	   /* its number in the plan; 0 leads */
	bool following;		   /* its set-point says mode POSE */
	u32 stops;		   /* of the plan, when it began to follow */

	/* Motion */
	struct incise_profile profile;
	struct incise_profile_slot slot;
	int given;	/* steps of the slot that are out */
	s64 base_ns;	/* begin of the slot's tick */
	s64 powered_ns; /* first step from then on */
	enum stepper_next next;
	s64 due_ns;

	/* The lines, at actual times: after the write */
	bool high;
	int direction; /* +1, -1 */
	s64 lead_ns, trail_ns, dir_ns;
	s64 lead_due_ns; /* of that step by the profile */
	u32 late_row;

	/* Evidence */
	struct stepper_histogram lateness, cost;
	struct stepper_histogram tick_cost; /* of its ticks alone */
	u64 edges, waits;		    /* pulses that the timer waited for */
};

#define STEPPER_EVENTS 1024 /* a power of two */

struct stepper_events {
	raw_spinlock_t lock;
	u64 seq; /* of the last one */
	struct incise_stepper_event ring[STEPPER_EVENTS];
};

struct stepper_sync_line {
	struct gpio_desc *line;
	raw_spinlock_t lock;
	struct hrtimer timer;
	struct incise_stepper_sync sync;
	bool running;
	bool high;
	s64 due_ns; /* of the leading edge that comes, or that just was */
};

struct stepper {
	struct device dev;
	struct cdev cdev;
	struct device *parent; /* only until unbind */
	int id;

	struct mutex loading; /* a plan: outside of mutex */
	struct mutex mutex;   /* owner, gone, and all set-up */
	struct file *owner;
	bool closing; /* reboot: no power any more */
	bool gone;

	struct stepper_plan *plan; /* NULL: there is none */

	struct incise_stepper_controller info;
	u32 firing_ns; /* self-test: an edge is late by it where the one before was just then */
	u32 tick_cost_ns; /* self-test: a step behind the ticks of all motors is late by it */
	struct incise_stepper_setpoint *setpoints;  /* page 0: untrusted */
	struct incise_stepper_motor_status *status; /* page 1 */
	struct gpio_desc *estop;
	struct stepper_irq estop_irq;
	struct delayed_work calm; /* interrupts of a storm may come back */
	struct stepper_sync_line sync;
	struct stepper_events events;
	wait_queue_head_t wait;
	struct task_struct *herald;    /* wakes readers of events */
	atomic_t news;		       /* events that it has not told */
	struct pm_qos_request latency; /* no idle states: stepper.mutex */
	struct work_struct look;       /* whether these may come back */
	bool awake;

	struct notifier_block reboot, panic;
	struct dentry *debugfs;

	unsigned int n_motors;
	struct stepper_motor motor[INCISE_STEPPER_MOTORS_MAX];
};

/* stepper_motor.c */
void stepper_motor_init(struct stepper_motor *motor);
void stepper_motor_start(struct stepper_motor *motor); /* motor->lock held */
void stepper_motor_compute(struct stepper_motor *motor);
void stepper_motor_end(struct stepper_motor *motor);
void stepper_motor_take(struct stepper_motor *motor, s64 now, s64 due);
void stepper_motor_want(struct stepper_motor *motor, s64 target);

/* stepper_stop.c: motor->lock held */
void stepper_stop_off(struct stepper_motor *motor, s64 now);
void stepper_stop_halt(struct stepper_motor *motor, s64 now);
void stepper_stop_fault(struct stepper_motor *motor, u32 fault, s64 now);
void stepper_stop_late(struct stepper_motor *motor, s64 now);
void stepper_stop_disable(struct stepper_motor *motor, s64 now);

/* stepper_plan.c, stepper_plan_load.c; without them there is never a plan */
#if IS_ENABLED(CONFIG_INCISE_STEPPER_PLAN)
#define STEPPER_PLAN_CAPABILITY INCISE_STEPPER_CAP_PLAN
int stepper_plan_make(struct stepper *stepper, const struct incise_stepper_plan *load,
		      struct stepper_plan **made);
void stepper_plan_free(struct stepper_plan *plan);
/* stepper.mutex held */
int stepper_plan_install(struct stepper *stepper, const struct incise_stepper_plan *load,
			 struct stepper_plan **plan);
void stepper_plan_take_out(struct stepper *stepper);
void stepper_plan_new_owner(struct stepper *stepper);
void stepper_plan_sweep(struct stepper *stepper);
u32 stepper_plan_let_go(struct stepper *stepper, u32 reason);
bool stepper_plan_leaving(const struct stepper *stepper);
void stepper_plan_wait(struct stepper *stepper, unsigned int most_ms);
void stepper_plan_disabled(struct stepper *stepper, u32 motors);
void stepper_plan_show(struct stepper *stepper, struct seq_file *file);
void stepper_plan_reset(struct stepper *stepper);
/* motor->lock held */
s64 stepper_plan_due(const struct stepper_motor *motor);
void stepper_plan_pose(struct stepper_motor *motor, s64 now, s64 due);
void stepper_plan_tick(struct stepper_motor *motor, s64 now);
bool stepper_plan_reads(const struct stepper_motor *motor);
void stepper_plan_follow(struct stepper_motor *motor, s64 now);
void stepper_plan_fault(struct stepper_motor *motor, u32 fault);
void stepper_plan_end(struct stepper_motor *motor, s64 now);
#else
#include "stepper_no_plan.h"
#endif

/* stepper_setup.c: take motor->lock themselves */
int stepper_setup_ready(struct stepper_motor *motor);
int stepper_setup_enable(struct stepper_motor *motor);
void stepper_setup_disable(struct stepper_motor *motor);
int stepper_setup_clearable(struct stepper_motor *motor);
void stepper_setup_clear(struct stepper_motor *motor);
int stepper_setup_config(struct stepper_motor *motor,
			 const struct incise_stepper_config *config);
void stepper_setup_get_config(struct stepper_motor *motor,
			      struct incise_stepper_config *config);
int stepper_setup_position(struct stepper_motor *motor,
			   const struct incise_stepper_origin *origin);
void stepper_setup_fault(struct stepper_motor *motor, u32 fault);
bool stepper_setup_any_powered(struct stepper *stepper);
void stepper_setup_halt(struct stepper_motor *motor);
void stepper_setup_unload(struct stepper_motor *motor); /* motor->lock held */

/* stepper_inputs.c: motor->lock held */
void stepper_inputs_sample(struct stepper_motor *motor, s64 now);
void stepper_inputs_one(struct stepper_motor *motor, enum stepper_input input, s64 now,
			bool edge);

/* stepper_status.c: motor->lock held */
void stepper_status_state(struct stepper_motor *motor, u32 state, s64 now);
void stepper_status_publish(struct stepper_motor *motor, s64 now);

/* stepper_node.c */
struct fwnode_handle *stepper_node_motor(struct device *dev, unsigned int motor);
int stepper_node_count(struct device *dev);
bool stepper_node_push_pull(const struct fwnode_handle *node, const char *name);

/* stepper_lines.c */
int stepper_lines_get(struct stepper *stepper, struct device *dev);
int stepper_lines_listen(struct stepper *stepper);
void stepper_lines_ignore(struct stepper *stepper);
void stepper_lines_init(struct stepper *stepper);

/* stepper_event.c */
void stepper_event_init(struct stepper *stepper);
int stepper_event_start(struct stepper *stepper);
void stepper_event_end(struct stepper *stepper);
void stepper_event_wake(struct stepper *stepper);
void stepper_event_put(struct stepper *stepper, const struct incise_stepper_event *event);
u64 stepper_event_last(struct stepper *stepper);
unsigned int stepper_event_take(struct stepper *stepper, u64 *after,
				struct incise_stepper_event *to, unsigned int n);

/* stepper_sync.c */
void stepper_sync_init(struct stepper *stepper);
int stepper_sync_set(struct stepper *stepper, const struct incise_stepper_sync *sync);
void stepper_sync_get(struct stepper *stepper, struct incise_stepper_sync *sync);
void stepper_sync_off(struct stepper *stepper);
void stepper_sync_resume(struct stepper *stepper);

/* stepper_latency.c */
void stepper_latency_init(struct stepper *stepper);
void stepper_latency_hold(struct stepper *stepper);
void stepper_latency_release(struct stepper *stepper);
void stepper_latency_event(struct stepper *stepper);
void stepper_latency_end(struct stepper *stepper);

/* stepper_ability.c */
int stepper_ability_measure(struct stepper *stepper);

/* stepper_defaults.c */
int stepper_defaults(struct stepper *stepper, struct device *dev);

/* stepper_file.c */
extern const struct file_operations stepper_file_operations;

/* stepper_histogram.c */
void stepper_histogram_add(struct stepper_histogram *histogram, s64 ns);

/* stepper_debugfs.c */
void stepper_debugfs_init(void);
void stepper_debugfs_exit(void);
void stepper_debugfs_add(struct stepper *stepper);
void stepper_debugfs_remove(struct stepper *stepper);

/* stepper_device.c */
struct stepper *stepper_device_new(struct device *parent, unsigned int n_motors);
int stepper_device_add(struct stepper *stepper);
void stepper_device_remove(struct stepper *stepper);
int stepper_device_init(void);
void stepper_device_exit(void);

/* stepper_configfs.c */
int stepper_configfs_init(void);
void stepper_configfs_exit(void);

#endif
