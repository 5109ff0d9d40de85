/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Coefficients between raw readings and millimetres and newtons. `incise calibrate` measures
 * them; without a file the paper's figures are taken.
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
	double force_mV_N; /**< sensitivity; nominal 1240 (paper 1, §2) */
	double force_zero_mV; /**< reading without load; NAN: measured at each recording's start */
	double depth_mm_px; /**< nominal 47.5/400 = 0.11875; the paper prints 0.118 */
	/* From acquisition to the quickest arrival, or to the timestamp where there is one, and
	 * its standard deviation; NAN: what the device says of itself, sd not known. */
	double force_delay_ms, force_delay_sd_ms;
	double tracker_delay_ms, tracker_delay_sd_ms;
	double camera_delay_ms, camera_delay_sd_ms;
	/** Tip of the blade from the tracked point, in the sensor's frame; default 0 0 0. */
	double tip_mm[3];
	/* The actuator, as the force channel has seen it; NAN: not known. */
	double stepper_N_step;	     /**< force per microstep, with its sign */
	double stepper_backlash_mm;  /**< travel lost where it turns round */
	double stepper_hysteresis_N; /**< between the two ways, at one position */
	double stepper_stiction_N;   /**< force at which it starts to move */
	double stepper_steps_s;	     /**< the largest rate that loses no step */
};

/** The paper's figures. */
INCISE_API void incise_calibration_nominal(struct incise_calibration *calibration);

/**
 * Read calibration.conf; keys that are absent keep their nominal value. Its history is
 * checked too, see incise_calibration_history().
 *
 * @return 0; negative errno of incise_infile_open(), -EINVAL (syntax, unknown key, a
 *         value out of range: file and line are named).
 */
INCISE_API int incise_calibration_load(const char *path,
				       struct incise_calibration *calibration,
				       struct incise_error *err);

/** The value in force of a key of the history; NAN: unknown, or there is no such key. */
INCISE_API double incise_calibration_get(const struct incise_calibration *calibration,
					 const char *key);

/** A coefficient that a calibration has measured. */
struct incise_calibration_value {
	char key[32]; /**< of calibration.conf; tip_x_mm, tip_y_mm, tip_z_mm for tip_mm */
	char unit[16]; /**< mV/N, mm/px, ms, … */
	double found;  /**< what was in force before; NAN: nothing */
	double left;   /**< what is from now on */
	double u;      /**< its standard uncertainty; U is twice that (k = 2) */
};

/** Values that one calibration gives at most. */
#define INCISE_CALIBRATION_VALUES 16

/** One calibration, as it stands in the history of calibration.conf. */
struct incise_calibration_record {
	char kind[16]; /**< force, depth, tip, delay, stepper: letters a to z */
	char date[32]; /**< UTC, as 2026-11-21T14:48:16Z; empty for append: now */
	char device[64];
	char method[120]; /**< in words */
	char raw[200];	  /**< name of the file with the raw data; empty: none was kept */
	uint32_t raw_crc; /**< CRC32C of it */
	int n;		  /**< values */
	struct incise_calibration_value values[INCISE_CALIBRATION_VALUES];
	/** Of values i and j, i >= j, at i(i + 1)/2 + j; n_covariance 0: not stated. */
	double covariance[INCISE_CALIBRATION_VALUES * (INCISE_CALIBRATION_VALUES + 1) /
			  2];
	int n_covariance;
	double low, high;    /**< it is valid from … to; NAN: not stated */
	char range_unit[16]; /**< of these: N, mm, … */
	bool pass;
	char verdict[200]; /**< why, in words */
};

/**
 * Append a calibration to a file, and put its values in force if it has passed. The file is
 * made where there is none, and replaced whole: whatever happens, the old or the new one is
 * there. Lines of comment before the history are kept, at the top; numbers are written so
 * that the same ones are read. Control characters in text become '?'.
 *
 * @return 0; as incise_calibration_load(), of incise_outfile_commit(); -EINVAL (a value of
 *         @record is not finite, out of the range of its key, or of an unknown key)
 */
INCISE_API int incise_calibration_append(const char *path,
					 const struct incise_calibration_record *record,
					 struct incise_error *err);

/**
 * Say in a record which file holds its raw data: its name, without folders, and CRC32C.
 *
 * @return 0; negative errno of open(2) and read(2)
 */
INCISE_API int incise_calibration_raw(struct incise_calibration_record *record,
				      const char *path, struct incise_error *err);

/**
 * The history of a file, oldest first.
 *
 * @param records to be freed with free(3)
 * @return how many; negative as incise_calibration_load()
 */
INCISE_API int incise_calibration_history(const char *path,
					  struct incise_calibration_record **records,
					  struct incise_error *err);

INCISE_END_DECLS
#endif
