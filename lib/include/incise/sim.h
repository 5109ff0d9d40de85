/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The simulated rig: a slab of liver with a known force law, a surgeon who cuts it, and the
 * devices that measure it. For demos, tests and development. Deterministic by seed: equal
 * configurations give equal samples, in real and in simulated time.
 *
 * Frame: z is the outward normal of the surface at z = 0; the cut runs along +x from the fixed
 * end at x = 0 towards the free end. Depth is -z of the blade's tip.
 */
#ifndef INCISE_SIM_H
#define INCISE_SIM_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Maximum number of nominal depths. */
#define INCISE_SIM_DEPTHS_MAX 8

/**
 * The configuration. The names are the keys of the `sim` group in rig.conf. Comments begin
 * with the default of incise_sim_config_init().
 */
struct incise_sim_config {
	uint64_t seed; /**< 1 */

	/*
	 * The surgeon's motion, for the duration of the cuts: 0 cuts; 1 rotates the tool about
	 * its tip, which rests at the start of the cuts; 2 presses on the tissue repeatedly
	 * without cutting it, so that the force has no saw-tooth; 3 holds the pose of
	 * incise_sim_hold().
	 */
	int motion;	 /**< 0 */
	double cone_deg; /**< 80; opening angle of the tool's cone, degrees, 0 … 170 */

	/* The surgeon: a list of cuts, each nominal depth repeated, then rest. */
	int n_depths;				/**< 4 */
	double depth_mm[INCISE_SIM_DEPTHS_MAX]; /**< 5 10 15 20 (Song et al. 2006) */
	int times[INCISE_SIM_DEPTHS_MAX];	/**< 3 4 4 3 */
	double cut_s;				/**< 8; duration of one cut */
	double pause_s;	    /**< 1; in the air before each cut and after the last */
	double speed_mm_s;  /**< 25; mean speed along the cut */
	double speed_swing; /**< 0.9; relative amplitude of its variation, 0 … 0.95 */

	/*
	 * The tissue: F(d, v) = (e1 d + e2 d²) (1 + c v/(v + v0)), times tooth and bound,
	 * while the blade cuts. When it withdraws, the tissue unloads, and then friction acts.
	 */
	double elastic1_N_mm;  /**< 0.045; e1 */
	double elastic2_N_mm2; /**< 0.0028; e2 */
	double viscous;	       /**< 0.35; c */
	double viscous_mm_s;   /**< 15; v0 */
	double tooth;	       /**< 0.2; saw-tooth amplitude, relative; 0 … 0.9 */
	double tooth_mm;       /**< 1.5; mean path between fractures */
	/** 0.1; sd of the factor between cuts, and size of its drift along the slab */
	double boundary;

	double unloading_N_mm; /**< 0.25; stiffness of unloading, above the law's slope */
	double friction;       /**< 0.1; share of F that resists motion in the open cut */
	int withdrawal;	       /**< 0 dissipative; 1 paper: F in both directions */

	/* Tracker. */
	double tracker_hz;	   /**< 120; all stations together */
	double tracker_noise_mm;   /**< 0.02; sd per axis */
	double tracker_latency_ms; /**< 4.2 */
	double tracker_jitter_ms;  /**< 0.2; sd of extra latency, never negative */
	double tracker_drift_ppm;  /**< 50; its clock runs fast by this */
	/** 0 0 0; true tip relative to the tracked point, in the scalpel's frame */
	double tip_x_mm, tip_y_mm, tip_z_mm;

	/*
	 * A second station, 2, at the end of a tube that moves down and up without end. The
	 * simulated tissue does not react to it.
	 */
	double tube_s; /**< 0; period of down and up, from above; 0: no tube */
	double tube_x_mm, tube_y_mm; /**< 20 0; its position */
	/** 200; highest position of its end above the surface */
	double tube_above_mm;
	double tube_below_mm; /**< 10; lowest position below it */

	/* Force channel. */
	double force_hz;	/**< 10000 */
	double force_mV_N;	/**< 1240 */
	double force_zero_mV;	/**< 180; offset of the bridge times gain */
	double force_noise_mV;	/**< 3; sd */
	double force_delay_ms;	/**< 0; of its timestamps, after the acquisition */
	double force_jitter_ms; /**< 0; sd of its timestamps */

	/* Camera. */
	double camera_hz;    /**< 50 */
	double camera_mm_px; /**< 0.11875 = 47.5 mm / 400 px */

	/*
	 * Actuators, see incise/stepper.h: the first pushes out of the surface, the second
	 * across the blade, along y, the third along the cut, x. The hand grips the handle
	 * along each axis. The nut of the first rests at 0; the others push both ways and rest
	 * half way.
	 */
	int axes;		  /**< 1; number, 1 … 3 */
	double spring_N_mm;	  /**< 2 */
	double lead_mm;		  /**< 2; per turn */
	int steps_per_turn;	  /**< 3200; microsteps */
	double travel_mm;	  /**< 20 */
	double screw_mm_s;	  /**< 30; largest speed of the nut */
	double screw_mm_s2;	  /**< 3000; largest acceleration */
	double handle_kg;	  /**< 0.05; mass of the handle */
	double handle_friction_N; /**< 0.01; Coulomb */
	double hand_N_mm;	  /**< 1; stiffness of the hand's grip */
	double hand_N_s_mm;	  /**< 0.01; damping of the hand's grip */

	/*
	 * Bench: the handle presses on the force sensor, and the force channel measures that
	 * force.
	 */
	int bench;	     /**< 0; 1: the actuator stands on the bench */
	double backlash_mm;  /**< 0; play between nut and spring */
	double hysteresis_N; /**< 0; loss of the spring between the two directions */
	double stiction_N;   /**< 0; static friction minus sliding friction */
	double stall_mm_s;   /**< 0; a faster nut loses its steps; 0: never */
};

struct incise_sim;

/** Set the defaults documented above. */
INCISE_API void incise_sim_config_init(struct incise_sim_config *config);

/** The configuration in use; owned by @sim. */
INCISE_API const struct incise_sim_config *incise_sim_config(
	const struct incise_sim *sim);

/** Duration of all cuts with their pauses, ns. */
INCISE_API int64_t incise_sim_duration(const struct incise_sim *sim);

/**
 * Load the force sensor with a weight in place of the blade, from now on. 0 is the empty pan;
 * NAN restores the blade.
 */
INCISE_API void incise_sim_load(struct incise_sim *sim, double load_N);

/**
 * Hold the scalpel at a pose from now on, with motion 3: a mouse or a script moves it. One
 * thread may call it while another reads the devices; real-time safe.
 *
 * @param position_mm   of the tip; @param velocity_mm_s of the tip
 * @param quaternion    unit, w first
 * @return 0, -EINVAL (another motion, or not finite, or more than 1e6 mm)
 */
INCISE_API int incise_sim_hold(struct incise_sim *sim, const double position_mm[3],
			       const double velocity_mm_s[3], const double quaternion[4]);

/** Force without saw-tooth and boundary effect: the best possible result of a model. */
INCISE_API double incise_sim_mean_force(const struct incise_sim_config *config,
					double depth_mm, double velocity_mm_s);

INCISE_END_DECLS
#endif
