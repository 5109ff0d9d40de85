/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Backends of devices: a table of functions per backend and kind. A backend embeds the struct
 * of its kind as its first member. Use this header only to write a backend
 * (doc/device-backend.md has a complete one); to use devices, include the header of their
 * kind.
 *
 * Rules for every table:
 *
 *  - read() takes samples that have arrived and never waits: 0 means "nothing yet", an errno
 *    ends the stream. A backend that must wait for its device does so in its own thread.
 *  - All functions are called by one thread at a time, between open and close.
 *  - close() frees everything that open() allocated, including the struct. It is called once.
 */
#ifndef INCISE_BACKEND_H
#define INCISE_BACKEND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/camera.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/force.h>
#include <incise/haptic.h>
#include <incise/scan.h>
#include <incise/stepper.h>
#include <incise/stepper_plan.h>
#include <incise/tracker.h>
#include <incise/vision.h>

INCISE_BEGIN_DECLS

/** Functions of a tracker; see incise/tracker.h. */
struct incise_tracker_ops {
	/** As incise_tracker_read(); INCISE_REALTIME if a haptic loop may read it. */
	int (*read)(struct incise_tracker *tracker, struct incise_tracker_sample *samples,
		    int n) INCISE_REALTIME;
	void (*info)(const struct incise_tracker *tracker,
		     struct incise_tracker_info *info);
	uint64_t (*lost)(const struct incise_tracker *tracker);
	void (*close)(struct incise_tracker *tracker);
	/** Cause of a read error; may be NULL. */
	int (*cause)(struct incise_tracker *tracker, char *text, size_t size);
};

/** A tracker: the first member of its backend's struct. */
struct incise_tracker {
	const struct incise_tracker_ops *ops;
};

/** Functions of a force channel; see incise/force.h. */
struct incise_force_ops {
	/** As incise_force_read(). */
	int (*read)(struct incise_force *force, struct incise_force_sample *samples,
		    int n);
	void (*info)(const struct incise_force *force, struct incise_force_info *info);
	uint64_t (*lost)(const struct incise_force *force);
	void (*close)(struct incise_force *force);
	/** Cause of a read error; may be NULL. */
	int (*cause)(struct incise_force *force, char *text, size_t size);
};

/** A force channel: the first member of its backend's struct. */
struct incise_force {
	const struct incise_force_ops *ops;
};

/** Functions of a haptic device; see incise/haptic.h. Its owner calls them, never a loop. */
struct incise_haptic_ops {
	/** As incise_haptic_read(). */
	int (*read)(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		    int n) INCISE_REALTIME;
	/** As incise_haptic_push(), of numbers that are finite and within the device's limits. */
	int (*push)(struct incise_haptic *haptic, const double force_N[3],
		    const double torque_N_mm[3]) INCISE_REALTIME;
	/**
	 * Wait for the device's next sample, at most @most_ns: of a device that is the clock, or
	 * whose messages need a poll(2). 0, or -EINTR. NULL: its owner waits by the clock, at
	 * info.rate_hz.
	 */
	int (*wait)(struct incise_haptic *haptic, int64_t most_ns);
	/** No force, then close. */
	void (*close)(struct incise_haptic *haptic);
	/* NULL: the members of struct incise_haptic say it. */
	void (*info)(const struct incise_haptic *haptic, struct incise_haptic_info *info);
	uint64_t (*lost)(const struct incise_haptic *haptic);
	/** Cause of an error, or of a flag of the last sample. */
	int (*cause)(struct incise_haptic *haptic, char *text, size_t size);
	/** Cuts and their last reason, of struct incise_haptic_ages; NULL: it has no owner. */
	unsigned int (*cuts)(const struct incise_haptic *haptic,
			     char why[INCISE_HAPTIC_CUT_MAX]);
};

/** A haptic device: the first member of its backend's struct. */
struct incise_haptic {
	const struct incise_haptic_ops *ops;
	/** open() fills it; then the library puts the settings of the rig in their places. */
	struct incise_haptic_info info;
	uint64_t lost; /**< samples */
	int error; /**< negative errno, for good: read() and push() are not called any more */
	char cause[400]; /**< of the error, or of a flag of the last sample; or "" */
	void *module;	 /**< set by the library */
};

/** Functions of a camera; see incise/camera.h. */
struct incise_camera_ops {
	/** As incise_camera_read(). */
	int (*read)(struct incise_camera *camera, struct incise_camera_frame *frame);
	void (*info)(const struct incise_camera *camera, struct incise_camera_info *info);
	uint64_t (*lost)(const struct incise_camera *camera);
	void (*close)(struct incise_camera *camera);
	/** Cause of a read error; may be NULL. */
	int (*cause)(struct incise_camera *camera, char *text, size_t size);
};

/** A camera: the first member of its backend's struct. */
struct incise_camera {
	const struct incise_camera_ops *ops;
};

/** Edge of the home input, or of the limit at 0, in the count of position_mm. */
struct incise_stepper_edge {
	bool seen;	    /**< found since it was enabled */
	double position_mm; /**< position of the last edge */
};

/** Parameters of homing. */
struct incise_stepper_homing {
	double speed_mm_s;    /**< speed of the approach */
	double edge_mm_s;     /**< speed of the second approach, for the edge */
	double clearance_mm;  /**< off the input between the two */
	double home_mm;	      /**< position of the edge in the machine */
	unsigned int home_at; /**< INCISE_STEPPER_LINE_HOME, or _AT_MIN without one */
};

/** Functions of a stepper whose controller runs plans; see incise/stepper_plan.h. */
struct incise_stepper_plan_ops {
	/** n ≥ 1 steppers of this backend. */
	int (*load)(struct incise_stepper *const *steppers, int n, const void *bytes,
		    size_t size, struct incise_error *err);
	int (*follow)(struct incise_stepper *stepper) INCISE_REALTIME;
	int (*pose)(struct incise_stepper *first,
		    const struct incise_stepper_pose_given *pose) INCISE_REALTIME;
	int (*rendered)(struct incise_stepper *stepper,
			struct incise_stepper_rendered *rendered) INCISE_REALTIME;
};

struct incise_driver;

/**
 * Functions of a driver chip between the step line and the motor: it has its own line to the
 * program and is opened after its stepper. All except faults may block.
 */
struct incise_driver_ops {
	/** Latched incise_stepper_fault bits. */
	unsigned int (*faults)(struct incise_driver *driver) INCISE_REALTIME;
	/** The first fault in words; 0: none. */
	int (*cause)(struct incise_driver *driver, char *text, size_t size);
	/** Set it up again, without faults. 0; -EBUSY (a cause persists), -EIO, -ENODEV. */
	int (*clear)(struct incise_driver *driver, struct incise_error *err);
	/** See incise_stepper_chip(), incise_stepper_counter(). NULL for an encoder. */
	int (*read)(struct incise_driver *driver, struct incise_stepper_chip *chip);
	int (*counter)(struct incise_driver *driver, int i,
		       struct incise_stepper_counter *counter);
	void (*close)(struct incise_driver *driver);
};

/** A driver chip: the first member of its backend's struct. */
struct incise_driver {
	const struct incise_driver_ops *ops;
	/** When it was opened it had been without supply, or off: the position is lost. */
	bool restarted;
	struct incise_driver *next; /**< the stepper's: another of the same motor */
};

/**
 * Functions of a stepper. NULL stands for a function that returns -EOPNOTSUPP. All except set,
 * jog and status may block.
 */
struct incise_stepper_ops {
	/** See the functions of incise/stepper.h; @err may be NULL. */
	int (*set)(struct incise_stepper *stepper, double position_mm) INCISE_REALTIME;
	int (*jog)(struct incise_stepper *stepper, double velocity_mm_s);
	int (*status)(struct incise_stepper *stepper,
		      struct incise_stepper_status *status) INCISE_REALTIME;
	int (*enable)(struct incise_stepper *stepper, struct incise_error *err);
	int (*disable)(struct incise_stepper *stepper, struct incise_error *err);
	int (*clear)(struct incise_stepper *stepper, struct incise_error *err);
	void (*info)(const struct incise_stepper *stepper,
		     struct incise_stepper_info *info);
	void (*close)(struct incise_stepper *stepper);

	/** The device's own description of its fault; 0: no description, and @text is unchanged. */
	int (*cause)(struct incise_stepper *stepper, char *text, size_t size);
	int (*counter)(struct incise_stepper *stepper, int i,
		       struct incise_stepper_counter *counter);

	/** For a drive that homes itself; others have the parts below. */
	int (*home)(struct incise_stepper *stepper, const volatile int *stop,
		    struct incise_stepper_edge_found *edge, struct incise_error *err);

	/* The parts of incise_stepper_home(). */

	/** 0; -EOPNOTSUPP: neither input is wired. */
	int (*homing)(struct incise_stepper *stepper,
		      struct incise_stepper_homing *homing);
	int (*edge)(struct incise_stepper *stepper, struct incise_stepper_edge *edge);
	/** Set its position count while at rest. 0, -EBUSY (it moves), -EIO. */
	int (*origin)(struct incise_stepper *stepper, double position_mm, bool homed);
	/** Wait; 0 or -EINTR. NULL: wait by the clock of the computer. */
	int (*wait)(struct incise_stepper *stepper, int64_t ns);

	/**
	 * Take a driver chip or an encoder, which lives longer; 0 or a negative errno. NULL: it has a power
	 * stage of its own.
	 */
	int (*attach)(struct incise_stepper *stepper, struct incise_driver *driver);
	/** Read the chip. */
	int (*chip)(struct incise_stepper *stepper, struct incise_stepper_chip *chip);

	const struct incise_stepper_plan_ops *plan; /**< NULL: it runs no plans */
};

/** A stepper: the first member of its backend's struct. */
struct incise_stepper {
	const struct incise_stepper_ops *ops;
};

/** Vision is not a device, but a module like one. */
struct incise_vision_ops {
	int (*measure)(struct incise_vision *vision,
		       const struct incise_camera_frame *frame,
		       struct incise_vision_result *result);
	/** The object has an empty setup. */
	int (*learn)(struct incise_vision *vision,
		     const struct incise_camera_frame *frame,
		     const struct incise_vision_box *box,
		     struct incise_vision_setup *setup, struct incise_error *err);
	void (*close)(struct incise_vision *vision);
};

/** Vision: the first member of its module's struct. */
struct incise_vision {
	const struct incise_vision_ops *ops;
};

struct incise_board;

/** Detection of boards, see incise/board.h, in the same way; it ignores the request. */
struct incise_board_ops {
	int (*find)(struct incise_board *board, const struct incise_camera_frame *frame,
		    int columns, int rows, double *corners, struct incise_error *err);
	void (*close)(struct incise_board *board);
};

/** Detection of boards: the first member of its module's struct. */
struct incise_board {
	const struct incise_board_ops *ops;
};

/** GPIO lines of the group `lines`; the first three are outputs. */
enum incise_actuator_line {
	INCISE_LINE_STEP,
	INCISE_LINE_DIR,
	INCISE_LINE_ENABLE,
	INCISE_LINE_LIMIT_MIN,
	INCISE_LINE_LIMIT_MAX,
	INCISE_LINE_HOME,
	INCISE_LINE_ESTOP,
	INCISE_LINE_ALARM,
};
#define INCISE_LINES 8	   /**< number of lines */
#define INCISE_LINES_OUT 3 /**< number of outputs */

/** Cyclic modes of CiA 402. */
enum incise_actuator_mode {
	INCISE_ACTUATOR_CSP, /**< positions; the drive closes all loops */
	INCISE_ACTUATOR_CSV, /**< velocities; the backend closes the position loop */
	INCISE_ACTUATOR_CST, /**< torques; the backend closes both loops */
};

/** A drive on a CAN bus: the group `can`. Units that are 0 come from the drive. */
struct incise_actuator_can {
	enum incise_actuator_mode mode;
	uint32_t bitrate;		  /**< 0: the interface's */
	uint32_t cycle_ns;		  /**< between SYNCs */
	double counts_per_turn;		  /**< position units per turn of the screw */
	double velocity_per_turn_s;	  /**< velocity units per turn/s: 60 for rpm */
	double acceleration_per_turn_s2;  /**< acceleration units per turn/s² */
	double following_mm, following_s; /**< largest following error, longest time */
	double start_s;			  /**< longest time to operation enabled */
	double answer_s;		  /**< longest time for the answer of an SDO */
	int homing_method;		  /**< number in CiA 402; 0: it cannot home */
	bool absolute;		      /**< the encoder keeps its count without power */
	double position_gain_1_s;     /**< csv: mm/s per mm */
	double stiffness_permille_mm; /**< cst: ‰ of the rated torque */
	double damping_permille_s_mm;
	double torque_max_permille;
	int master; /**< node id of this program's heartbeat, 1 … 127 */
};

/** A driver chip of TRINAMIC: the group `tmc`. */
struct incise_actuator_tmc {
	double sense_ohm;
	double run_A, hold_A; /**< root mean square */
	bool interpolate;
	bool stealthchop;
	double stealthchop_mm_s; /**< SpreadCycle above it; 0: never */
	double stall_mm_s;	 /**< StallGuard from it on; 0: never */
	int stall_threshold;
	bool stall_home; /**< a stall is the edge of the home input, and no fault */
	double answer_s; /**< longest time for the answer of a TMC2209 */
};

/** The group `actuator` of rig.conf. */
struct incise_actuator {
	double spring_N_mm, travel_mm;
	double lead_mm;	    /**< travel per turn of the screw */
	int steps_per_turn; /**< whole steps of the motor */
	int microsteps;	    /**< per whole step */
	bool invert;	    /**< a step up needs the dir line inactive */
	double velocity_mm_s, acceleration_mm_s2;
	double jerk_mm_s3; /**< 0: no limit */
	double deadman_s;
	bool retract; /**< after the deadman, move to rest_mm before power goes off */
	bool volatile_home; /**< not homed any more after each power off */
	int lost_steps_max; /**< steps that may be missing; 0: any number */
	char encoder[64];   /**< counterN/countM of its count; "": none */
	double encoder_counts_per_mm;
	uint32_t tick_ns;
	uint32_t high_ns, low_ns; /**< 0: not given: the shortest of the machine */
	uint32_t setup_ns, hold_ns;
	uint64_t enable_ns;
	double home_mm_s, home_mm;
	bool has_home;		 /**< the file has home_mm */
	double origin_mm;	 /**< see struct incise_stepper_info */
	double rest_mm, late_s;	 /**< see struct incise_stepper_info */
	double direction[3];	 /**< of its force, unit; 0 0 0: not given */
	bool has_lines;		 /**< the file has the group `lines` */
	int line[INCISE_LINES];	 /**< offsets; -1: not wired */
	unsigned int active_low; /**< bits 1 << incise_actuator_line */
	struct incise_actuator_can can;
	char driver[100]; /**< of its driver chip, BACKEND:ARGUMENTS; "": none */
	struct incise_actuator_tmc tmc;
};

/** Version of the structs and values that backends use. */
#define INCISE_BACKEND_ABI 13

/** Settings of rig.conf for a backend. */
struct incise_backend_request {
	const char *arguments;	    /**< text after "NAME:" */
	const char *where;	    /**< begin of messages: "FILE:LINE: stepper" */
	struct incise_clock *clock; /**< real; valid as long as the device */
	bool watch; /**< only read: do not move the device or disturb its owner */
	/* Settings for its kind, or defaults; copy them. */
	const struct incise_actuator *actuator; /**< for a stepper, or a driver */
	const struct incise_tracker_setup *tracker;
	const struct incise_force_setup *force;
	const struct incise_camera_setup *camera;
	const struct incise_haptic_setup *haptic;
	const struct incise_vision_setup *vision; /**< to be checked */
	/**
	 * For a stepper: the rig's steppers that this backend opened before; they may be
	 * motors of the same device.
	 */
	struct incise_stepper *const *siblings;
	int n_siblings;
	/** For a driver: those of the rig's drivers that this backend opened before. */
	struct incise_driver *const *drivers;
	int n_drivers;
};

/**
 * A backend. A module, KIND_NAME.so in the folder incise/ next to libincise.so or in
 * INCISE_MODULE_PATH, exports one as the symbol `incise_backend`:
 *
 *     const struct incise_backend incise_backend = {
 *             .abi = INCISE_BACKEND_ABI, .kind = "stepper", .name = "mine", .open = f};
 *
 * The library loads it when rig.conf has stepper = "mine:ARGUMENTS".
 */
struct incise_backend {
	unsigned int abi; /**< INCISE_BACKEND_ABI */
	const char *kind; /**< "tracker", "force", "camera", "stepper", "haptic", … */
	const char *name; /**< fewer than 32 letters a to z, digits, underscores */
	/**
	 * Open a device. close() must bring a powered device to rest.
	 *
	 * @return the struct of the kind, for example struct incise_stepper; NULL with
	 *         errno and a message in @err.
	 */
	void *(*open)(const struct incise_backend_request *request,
		      struct incise_error *err);
	/**
	 * Search for devices as incise_scan() does. NULL: not supported.
	 * @arguments come from the device's string, possibly incomplete: "can0"
	 */
	int (*scan)(const char *arguments, incise_scan_found *found, void *context,
		    struct incise_error *err);
};

/**
 * The folder of the modules: INCISE_MODULE_PATH, or the folder incise/ beside libincise.so.
 *
 * @return whether it is known and its name fits; *path is undefined otherwise
 */
INCISE_API bool incise_module_folder(char *path, size_t size);

/** The only symbol that a module exports. */
INCISE_API extern const struct incise_backend incise_backend;

INCISE_END_DECLS
#endif
