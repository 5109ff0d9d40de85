/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reading a recording, and exporting it as a dataset (Song et al. 2006, §4.1). Part of
 * libincise-record.
 */
#ifndef INCISE_RECORDING_H
#define INCISE_RECORDING_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/tracker.h>

INCISE_BEGIN_DECLS

/** Largest number of streams of a recording. */
#define INCISE_STREAMS_MAX 3

/**
 * A stream of a recording: its losses and its times. NAN: unknown.
 *
 *     acquisition ──── delay ────► earliest ──── jitter ────► arrival   (CLOCK_MONOTONIC)
 *                                  arrival       ≥ 0
 *
 * Times of a timestamped stream come from the device or the kernel, and its jitter is the timestamps'. Times of
 * other streams come from a line below all arrivals, which models the device's clock.
 */
struct incise_stream {
	char name[16]; /**< force, tracker, camera */
	char device[64];
	bool timestamped; /**< kernel or converter take the time of acquisition */
	double nominal_hz;
	double delay_ms, delay_sd_ms; /**< from the calibration or the device */
	uint64_t rows, lost;
	uint64_t late;	/**< more than a period behind the line */
	double rate_hz; /**< measured with this computer's clock */
	/** drift of the device's clock; fast is positive */
	double drift_ppm, drift_sd_ppm;
	double jitter_ms;     /**< standard deviation of arrivals or timestamps */
	double jitter_max_ms; /**< largest distance above the line */
	double offset_ms;     /**< total: delay plus expected error of the line */
	/**
	 * Standard uncertainty of times on this clock; without the delay's if delay_sd_ms is NAN.
	 */
	double offset_sd_ms;
	char ended[200]; /**< cause of an early end; empty: no early end */
	char note[300];	 /**< a doubt of the device or its settings; empty: none */
};

struct incise_recording;

/** A cut starts above this depth, mm. */
#define INCISE_CUT_START_MM 0.3
/** And ends below this one: apart by ten times the tracker's noise, which ends no cut so. */
#define INCISE_CUT_END_MM 0.1

/** The contents of a recording. */
struct incise_recording_info {
	bool complete; /**< closed by its recorder; else readable up to the last commit */
	/** first and last force sample, else of the tracker, CLOCK_MONOTONIC */
	int64_t start_ns, end_ns;
	char started[32]; /**< wall clock at start_ns, ISO 8601 UTC, in seconds */
	char rig[256];	  /**< rig as given */
	uint64_t force, tracker, depth; /**< rows */
	uint64_t force_lost, tracker_lost, force_clipped;
	int bits;		       /**< 0: without a force channel */
	double full_scale_V, offset_V; /**< range of 2^bits codes; voltage of code 0 */
	double force_mV_N, zero_mV, depth_mm_px; /**< calibration in use */
	double surface_normal[3], surface_point_mm[3];
	double tip_mm[3]; /**< calibrated tip; applied to depth, not to poses */
	int cuts;	  /**< periods with the blade in the tissue */
	double depth_max_mm, force_max_N;
	struct incise_stream streams[INCISE_STREAMS_MAX]; /**< none if it had format 1 */
	int n_streams;
	bool newtons; /**< the force channel measures N: read full_scale_V, offset_V as N */
	/** UTC of start_ns, ns since 1970, by the wall clock to one second; 0: not known */
	int64_t start_utc_ns;
	/** cuts and largest values are those that the recorder found, which are sealed; no sample was read */
	bool summary;
};

/**
 * Open a recording for reading. If NAME.rec does not exist but NAME.rec.part does, after a
 * crash or a full disk, open that.
 *
 * @return recording, to be closed with incise_recording_close(); NULL with errno ENOENT,
 *         EINVAL (not a recording, damaged, or of a newer version), ENOTSUP (of format 1 to 3: it is converted
 *         by incise_recording_recover()), EIO, ENOMEM.
 */
INCISE_API struct incise_recording *incise_recording_open(const char *path,
							  struct incise_error *err);
/** NULL is accepted. */
INCISE_API void incise_recording_close(struct incise_recording *recording);

/** The work of incise_recording_recover(). */
struct incise_recovered {
	int form; /**< format of the recording */
	bool converted;
	/** In seal-before/: of the recording before its conversion. */
	int signatures, timestamps;
	char altered[400]; /**< first finding, if it was converted as it is; else "" */
};

/**
 * Copy an interrupted recording to a folder that does not exist: its database with the changes in its log, or
 * without the changes that its journal takes back, and all else bit for bit. It is as incomplete as it was;
 * reading it needs no private copy. A recording of an older format, interrupted or complete, is converted to
 * today's, after a check by its ledger. The recording that is read stays as it is.
 *
 * @param damaged convert one that is not as it was recorded, too
 * @return 0; -EEXIST (@p output), -EBUSY (it is being written), -EINVAL (no recording, damaged, or one with
 *         files that none has), -EBADMSG (of an older format, and not as it was recorded), those of mkdir(2)
 *         and write(2).
 */
INCISE_API int incise_recording_recover(const char *path, const char *output,
					bool damaged, struct incise_recovered *made,
					struct incise_error *err);

/** Its name, which cuts and origins have: the folder's without .rec. It belongs to the recording. */
INCISE_API const char *incise_recording_name(const struct incise_recording *recording);

/**
 * Get the contents: of a complete recording that has not been recalibrated, from format 5 on, from its summary,
 * else of all samples. @return 0, -EINVAL (an invalid row), -EIO.
 */
INCISE_API int incise_recording_info(struct incise_recording *recording,
				     struct incise_recording_info *info,
				     struct incise_error *err);

/** The same, of all samples in any case, which are checked. */
INCISE_API int incise_recording_measure(struct incise_recording *recording,
					struct incise_recording_info *info,
					struct incise_error *err);

/** A value of a stream. */
struct incise_recording_value {
	int64_t t_ns; /**< best time of its acquisition, CLOCK_MONOTONIC */
	double value;
};

/**
 * Read a whole stream: "force", N (NAN if clipped; relative to the converter's 0 V if the zero
 * is unknown); "depth", mm, from the tracker; "camera", mm, from vision, only of frames with a
 * detected scalpel.
 *
 * @param values to be freed with free(3)
 * @return number of values, 0 without the stream; -EINVAL (no such name, an invalid row),
 *         -EIO, -ENOMEM.
 */
INCISE_API int incise_recording_values(struct incise_recording *recording,
				       const char *name,
				       struct incise_recording_value **values,
				       struct incise_error *err);

/**
 * Read all poses of the tracker as received, with their best times.
 *
 * @param poses to be freed with free(3)
 * @return number of poses; -EINVAL (an invalid row), -EIO, -ENOMEM.
 */
INCISE_API int incise_recording_poses(struct incise_recording *recording,
				      struct incise_tracker_sample **poses,
				      struct incise_error *err);

/** Exposed length in a frame, with the tracker's depth at that time. */
struct incise_recording_length {
	int64_t t_ns; /**< time of the frame, CLOCK_MONOTONIC */
	double length_px;
	double quality;	 /**< as in incise/vision.h */
	double depth_mm; /**< below 0 in the air */
	double velocity_mm_s;
};

/**
 * Read all frames with a detected scalpel, in order, with the depth interpolated between the
 * tracker records around each. Frames without a record within 50 ms on both sides are omitted.
 *
 * @param lengths to be freed with free(3); NULL for none
 * @return number of frames; -EINVAL (an invalid row),
 *         -EIO, -ENOMEM
 */
INCISE_API int incise_recording_lengths(struct incise_recording *recording,
					struct incise_recording_length **lengths,
					struct incise_error *err);

struct incise_camera_frame;
struct incise_frame_reader;

/**
 * Read the frames of a recording's camera.mkv, by their times.
 *
 * @return reader, to be freed with incise_frame_reader_free(); it reads by connections of its own.
 *         NULL with errno ENODATA (without frames), EINVAL, EIO,
 *         ENOMEM; ENOENT, ENOEXEC (the file, or the module that reads it).
 */
INCISE_API struct incise_frame_reader *incise_frame_reader_new(
	struct incise_recording *recording, struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_frame_reader_free(struct incise_frame_reader *reader);

/** The codec of the file: "magicyuv" or "ffv1", lossless; "mjpeg"; NULL: no frame was written. */
INCISE_API const char *incise_frame_reader_codec(
	const struct incise_frame_reader *reader);

/**
 * Get the frame whose t_ns is nearest. Frames before the last one that
 * was read make it start at the file's beginning; later ones are quick.
 *
 * @param frame t_ns is the row's, CLOCK_MONOTONIC; data as the camera sent it (MJPEG) or
 *              without row padding, valid until the next call
 * @return 0; -ENODATA (no row), -EBADMSG (the frame is missing in the file or was altered), -EINVAL,
 *         -EIO, -ENOMEM.
 */
INCISE_API int incise_frame_reader_at(struct incise_frame_reader *reader, int64_t t_ns,
				      struct incise_camera_frame *frame,
				      struct incise_error *err);

/** Columns of standard uncertainties; see incise/budget.h. */
enum incise_export_uncertainty {
	INCISE_EXPORT_NONE, /**< no uncertainties; for resampled rows by noise and time */
	INCISE_EXPORT_TOTAL, /**< of each force, depth, velocity and time */
	INCISE_EXPORT_PARTS, /**< these, and each of their parts */
};

/** Options of an export. */
struct incise_export_options {
	/** Rows per second of raw export, each with mean force; 0: every force sample. */
	double rate_hz;
	int depth_bins; /**< 0: raw; else averaged over depth_bins × velocity_bins */
	int velocity_bins;
	double depth_max_mm; /**< end of the bins; 0: largest with an advancing blade */
	double velocity_max_mm_s;
	bool by_cut;   /**< average each cut separately, with a column cut */
	int min_count; /**< bins with fewer force samples are omitted; default 50 */

	/**
	 * The whole recording, with the pose, at each force sample or, with a rate, on a grid;
	 * see incise-export(1).
	 */
	bool resample;
	/**
	 * Replaces the recordings' calibration of force, camera depth, and the delays that it
	 * has.
	 */
	const struct incise_calibration *calibration;
	bool provenance; /**< CSV starts with lines "# key: value"; others always have it */
	bool ros2;	 /**< MCAP with messages of ROS 2, see incise_export() */
	/** Also columns tai_ns and tai_u_ns, the bound of its error; not of averages in bins. */
	bool tai;
	/** Not with messages of ROS 2, which have no place for them. */
	enum incise_export_uncertainty uncertainty;
	/**
	 * Part of a recording: seconds from its first sample, 0: to its end; and the number of a cut, from 1, or
	 * 0. Rows equal the rows of the whole export; samples before and behind are not read, except the poses
	 * before.
	 */
	double from_s, to_s;
	int cut;
	/**
	 * Overview of a long recording, of the rows of a stream alone: blocks of rows, about 0.1 s each, at times this
	 * far apart, s. 0, and in recordings of formats before 5: all rows.
	 */
	double every_s;
	/** File of @ref calibration, whose history states uncertainties; NULL: unknown uncertainties. */
	const char *calibration_path;

	/**
	 * Called at intervals with the completed share, 0 to 1, or NULL; a value other than 0
	 * stops the export.
	 */
	int (*progress)(void *context, double share);
	void *context;
};

/** Set the defaults: raw, every force sample of each cut, the recordings' own calibration. */
INCISE_API void incise_export_options_init(struct incise_export_options *options);

/** Result of an export. */
struct incise_export_report {
	uint64_t rows;
	int cuts;
	uint64_t clipped; /**< force samples at an end of the converter; not averaged */
	double depth_max_mm, velocity_max_mm_s;
	/**
	 * The unknown uncertainties, whose columns are NaN: "QUANTITY: REASON; REASON…", separated by newlines;
	 * empty: all are known.
	 */
	char unstated[1000];
	/**
	 * Resampled, with a camera: its depth over the tracker's, a ratio, and the difference that this makes
	 * over the measured depths; NAN: not both measured depths of 3 mm and more; 0 where rows are not
	 * resampled.
	 */
	double camera_ratio, camera_off_mm;
};

/**
 * Export to a file. Its extension selects the format: .h5 and .hdf5 are HDF5, .mcap is MCAP,
 * others are CSV. The file appears under its name when it is complete.
 *
 * CSV has the cuts of one or more recordings. Raw:
 * cut,t_s,depth_mm,velocity_mm_s,force_N,clipped, advancing. Averaged:
 * [cut,]depth_mm,velocity_mm_s,force_N,sd_N,count,cuts,advancing, each bin once with the
 * advancing blade and once without. Depth and velocity are interpolated at the times of the
 * force samples.
 *
 * Uncertainties have columns as in incise/budget.h. Uncertainties of means are for the mean: its own parts
 * shrink with the number of independent samples, the common parts do not.
 *
 * HDF5 has a one-dimensional dataset per column, with its name and the attributes units and
 * description, with uncertainties also uncertainty_variables, ancillary_variables, uncertainty_of
 * and correlation; the column cut has indices from 1 into the dataset cut_names. The root's
 * attributes are the provenance.
 *
 * MCAP has one whole recording for viewers, not only its cuts: /force, /tracker, /depth and
 * /events in JSON. In the report, rows is then the number of messages, and cuts is 0. With
 * @ref incise_export_options.ros2 its messages are messages of ROS 2, with the camera's frames, in
 * metres and UTC: /tip, /force, /events, /camera/image; poses that the tracker flags as unusable
 * are omitted.
 *
 * @param recordings n recordings
 * @param report     or NULL
 * @return 0; -ENODATA (no cut in any recording; no wall time), -EINVAL, -EIO, -ENOSPC, -ENOMEM; -ENOENT
 *         without the module export_hdf5.so; -EINTR if progress stopped it; errno of
 *         incise_outfile_open().
 */
INCISE_API int incise_export(struct incise_recording *const *recordings, int n,
			     const struct incise_export_options *options,
			     const char *path, struct incise_export_report *report,
			     struct incise_error *err);

INCISE_END_DECLS
#endif
