/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Coefficients that convert raw readings to millimetres, newtons and seconds. `incise
 * calibrate` measures them; without a file the values of Song et al. (2006) apply.
 */
#ifndef INCISE_CALIBRATION_H
#define INCISE_CALIBRATION_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Coefficients; the names are the keys of calibration.conf. */
struct incise_calibration {
	double force_mV_N; /**< sensitivity; nominal 1240 (Song et al. 2006, §2) */
	/** Reading without load; NAN: measured at the start of each recording. */
	double force_zero_mV;
	double depth_mm_px; /**< nominal 47.5/400 = 0.11875; Song et al. print 0.118 */
	/*
	 * Delay from acquisition to the earliest arrival, or to the timestamp if there is one,
	 * and its standard deviation; NAN: the device's own value, standard deviation unknown.
	 */
	double force_delay_ms, force_delay_sd_ms;
	double tracker_delay_ms, tracker_delay_sd_ms;
	double camera_delay_ms, camera_delay_sd_ms;
	/**
	 * Position of the blade's tip relative to the tracked point, in the sensor's frame;
	 * default 0 0 0.
	 */
	double tip_mm[3];
	/**
	 * Standard uncertainty of the tissue surface of rig.conf along its normal; NAN: not
	 * stated.
	 */
	double surface_u_mm;
	/* The actuator as measured with the force channel; NAN: unknown. */
	double stepper_N_step;	     /**< force per microstep, with its sign */
	double stepper_backlash_mm;  /**< travel lost at a reversal */
	double stepper_hysteresis_N; /**< between the directions at one position */
	double stepper_stiction_N;   /**< force at which it starts to move */
	double stepper_steps_s;	     /**< largest rate without lost steps */
	/**
	 * Place of a haptic device in the scene: its turn as an axis, in the scene, times the
	 * angle, and its origin; NAN: as rig.conf says. See incise_calibration_frame().
	 */
	double frame_turn_deg[3], frame_mm[3];
};

/** Set the values of Song et al. (2006). */
INCISE_API void incise_calibration_nominal(struct incise_calibration *calibration);

/**
 * Read calibration.conf; absent keys keep their nominal value. The history is validated, too;
 * see incise_calibration_history().
 *
 * @return 0; negative errno of incise_infile_open(), -EINVAL (syntax, unknown key, a value out
 *         of range; the error names file and line).
 */
INCISE_API int incise_calibration_load(const char *path,
				       struct incise_calibration *calibration,
				       struct incise_error *err);

/**
 * The same, but absent keys keep the value that @calibration has.
 *
 * @return as incise_calibration_load(); then @calibration is unchanged
 */
INCISE_API int incise_calibration_update(const char *path,
					 struct incise_calibration *calibration,
					 struct incise_error *err);

/** The active value of a key of the history; NAN: unknown, or no such key. */
INCISE_API double incise_calibration_get(const struct incise_calibration *calibration,
					 const char *key);

/**
 * Get the place of a haptic device in the scene.
 *
 * @param turn set to a unit quaternion, w first, from the device's to the scene's frame
 * @return false: not calibrated; then both are unchanged
 */
INCISE_API bool incise_calibration_frame(const struct incise_calibration *calibration,
					 double turn[4], double origin_mm[3]);

/** A coefficient measured by a calibration. */
struct incise_calibration_value {
	char key[32]; /**< of calibration.conf; tip_x_mm, tip_y_mm, tip_z_mm for tip_mm … */
	char unit[16]; /**< mV/N, mm/px, ms, … */
	double found;  /**< previous value; NAN: no value */
	double left;   /**< new value */
	double u;      /**< standard uncertainty; U is twice that (k = 2) */
};

/** A line of the uncertainty budget of a calibration's result. */
struct incise_calibration_part {
	const char *source;  /**< static */
	char type;	     /**< 'A': from the statistics of readings; 'B': other */
	double u;	     /**< standard uncertainty of the source, in @unit */
	const char *unit;    /**< static */
	double sensitivity;  /**< change of the result per unit */
	double contribution; /**< u times that: part of the result's u, added in squares */
};

/** Largest number of lines of a budget. */
#define INCISE_CALIBRATION_PARTS 6

/** The uncertainty budget of a calibration's result. */
struct incise_calibration_budget {
	int n;
	struct incise_calibration_part part[INCISE_CALIBRATION_PARTS];
};

/** Largest number of values of a calibration. */
#define INCISE_CALIBRATION_VALUES 16

/** A calibration in the history of calibration.conf. */
struct incise_calibration_record {
	char kind[16]; /**< force, depth, tip, delay, stepper, frame: letters a to z */
	char date[32]; /**< UTC, as in 2026-11-21T14:48:16Z; empty for append: now */
	char device[64];
	char method[120]; /**< in words */
	char raw[200];	  /**< name of the file with the raw data; empty: no file */
	uint32_t raw_crc; /**< CRC32C of that file */
	int n;		  /**< number of values */
	struct incise_calibration_value values[INCISE_CALIBRATION_VALUES];
	/**
	 * Covariance of values i and j, i >= j, at i(i + 1)/2 + j; n_covariance 0: not stated.
	 */
	double covariance[INCISE_CALIBRATION_VALUES * (INCISE_CALIBRATION_VALUES + 1) /
			  2];
	int n_covariance;
	double low, high;    /**< range of validity; NAN: not stated */
	char range_unit[16]; /**< unit of low and high: N, mm, … */
	bool pass;
	char verdict[200]; /**< reason, in words */
};

/**
 * Append a calibration to a file, and make its values active if it has passed. A missing file
 * is created. An existing file is replaced atomically: after any failure the old or the new
 * file is complete. Comment lines before the history remain, at the top. Numbers are written
 * so that reading gives the same values. Control characters in text become '?'.
 *
 * @return 0; as incise_calibration_load(), of incise_outfile_commit(); -EINVAL (a value of
 *         @record is not finite, out of the range of its key, or of an unknown key)
 */
INCISE_API int incise_calibration_append(const char *path,
					 const struct incise_calibration_record *record,
					 struct incise_error *err);

/**
 * Enter the file with the raw data into a record: its name, without folders, and its CRC32C.
 *
 * @return 0; negative errno of open(2) and read(2)
 */
INCISE_API int incise_calibration_raw(struct incise_calibration_record *record,
				      const char *path, struct incise_error *err);

/**
 * The history of a file, oldest first.
 *
 * @param records to be freed with free(3)
 * @return number of records; negative errno as incise_calibration_load()
 */
INCISE_API int incise_calibration_history(const char *path,
					  struct incise_calibration_record **records,
					  struct incise_error *err);

/**
 * The last value that a calibration which passed gave to a key. Thread-safe; not real-time safe.
 *
 * @param record set to its calibration; or NULL
 * @return a part of @records; NULL: none
 */
INCISE_API const struct incise_calibration_value *incise_calibration_last(
	const struct incise_calibration_record *records, int n, const char *key,
	const struct incise_calibration_record **record);

/**
 * Read the text of a calibration.conf, for example of a recording: its values as
 * incise_calibration_load(), and its history as incise_calibration_history().
 *
 * @param name    of the text, for errors
 * @param records to be freed with free(3); or NULL: values only
 * @return number of records, 0 with records NULL; -EINVAL, -ENOMEM. Thread-safe; not real-time
 *         safe.
 */
INCISE_API int incise_calibration_text(const char *text, const char *name,
				       struct incise_calibration *calibration,
				       struct incise_calibration_record **records,
				       struct incise_error *err);

/** Whether calibration.conf may have this key at its top level. */
INCISE_API bool incise_calibration_has_key(const char *key);

INCISE_END_DECLS
#endif
