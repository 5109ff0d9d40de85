/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A plan as a file: everything for a tick of a scene on a rig, in integers. The kernel module
 * runs it, and programs run it with the same code.
 *
 *   SCENE + rig ─ incise compile ─▶ NAME.plan ─ incise feed ─▶ incise_stepper.ko
 *
 * The file is little-endian: magic "INCISEPL", version, size and CRC-32C, then the numbers, a
 * compiled model and the heights of a surface; lib/fixed/plan.h has its fields. Library and
 * kernel validate it completely with the same code before they use it.
 */
#ifndef INCISE_PLAN_FILE_H
#define INCISE_PLAN_FILE_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/plan.h>

/** A plan as a file; constant. */
struct incise_plan_file;

/** Contents of a plan file. */
struct incise_plan_file_info {
	char scene[64];	  /**< the scene's file, without its folder */
	char surface[32]; /**< its kind in the scene: "plane", "mesh" … */
	uint32_t crc; /**< CRC-32C of the bytes after it: the kernel's name of the plan */
	size_t size;  /**< bytes */
	double bound_N; /**< certified error; see incise_plan_bound() */
	double rate_hz;
	double pose_age_s; /**< without a younger pose the force ramps to 0 */
	double fade_s;	   /**< longest time from the last pose until there is no force */
	double force_N;	   /**< largest force */
	double slew_N_s;   /**< largest change of force */
	double tracker_hz, latency_s;
	bool model;   /**< the reaction comes from a model */
	bool inserts; /**< handle and tube are usable */
	bool tube;    /**< the tube has a station of the tracker */
	bool membrane;
	int cuts_most; /**< largest number of cuts; 0 without @inserts */
	int n_axes;    /**< actuators */
	struct {
		double direction[3];
		double spring_N_mm, travel_mm, step_mm;
	} axis[INCISE_RIG_AXES_MAX];
	int columns, rows;	  /**< of the surface's heights; 0: a formula */
	double cell_mm, reach_mm; /**< largest depth; deeper is clamped to it */
};

/**
 * Convert a plan to a plan file.
 *
 * @param plan of a scene with arithmetic "fixed", see incise_scene_set_arithmetic(), and of a
 *             rig whose actuators do not measure their handle
 * @return plan file, to be freed with incise_plan_file_free(); NULL with errno EINVAL
 *         (arithmetic "double"), ERANGE (a number or a surface out of the range of the
 *         integers; the message names it), ENOTSUP (an actuator that measures its handle),
 *         ENOMEM
 */
INCISE_API struct incise_plan_file *incise_plan_file_new(const struct incise_plan *plan,
							 struct incise_error *err);

/**
 * Read a plan file and validate it completely.
 *
 * @return as incise_plan_file_new(); NULL with errno of incise_infile_read(), EINVAL (not a
 *         plan file, or damaged), ENOTSUP (another version), ENOMEM
 */
INCISE_API struct incise_plan_file *incise_plan_file_load(const char *path,
							  struct incise_error *err);

/** Write a plan file, completely or not at all. @return 0 or as incise_outfile_commit(). */
INCISE_API int incise_plan_file_save(const struct incise_plan_file *file,
				     const char *path, struct incise_error *err);

/** Get its contents. */
INCISE_API void incise_plan_file_info(const struct incise_plan_file *file,
				      struct incise_plan_file_info *info);

/** The bytes for the kernel; valid as long as @file. */
INCISE_API const void *incise_plan_file_bytes(const struct incise_plan_file *file,
					      size_t *size);

/** NULL is accepted. */
INCISE_API void incise_plan_file_free(struct incise_plan_file *file);

#endif
