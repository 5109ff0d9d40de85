/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The parts of incise serve, in one thread:
 *
 *     source ── samples ──▶ stream: rate, means, UTC ── items ──▶ sinks: OpenIGTLink, LSL, ROS 2, pages
 *     (loop, rig, recording)                                      (each with its clients)
 *
 * A source names the time of the next request for its new samples. A sink takes items and
 * never waits. Lengths in mm, forces in N.
 */
#ifndef INCISE_TOOLS_SERVE_H
#define INCISE_TOOLS_SERVE_H

#include <stdbool.h>
#include <stdint.h>
#include <jansson.h>
#include <incise/calibration.h>
#include <incise/camera.h>
#include <incise/outlet.h>
#include <incise/state.h>

/* --- items ----------------------------------------------------------------------------- */

enum serve_kind {
	SERVE_POSE,
	SERVE_FORCE,
	SERVE_FRAME,
	SERVE_STATUS,
	SERVE_DEPTH, /* these are for pages alone */
	SERVE_LOOP,
	SERVE_KINDS
};

enum serve_state {
	SERVE_RUNS,
	SERVE_STARTS, /* not ready yet */
	SERVE_FAULT,  /* a device or the loop failed */
	SERVE_ENDED,  /* as asked, or at the end of the recording */
	SERVE_ABSENT, /* the loop's process is dead */
};

/* A value to send. Pointers are valid during the call. */
struct serve_item {
	enum serve_kind kind;
	int64_t t_ns; /* acquisition, CLOCK_MONOTONIC of the source */
	int64_t here_ns; /* the same on this machine's clock: of a recording, when it is played */
	int64_t utc_ns; /* the same as UTC, ns since 1970; 0: not known */
	uint64_t lost;	/* samples that the source lost so far */
	union {
		struct {
			double position_mm[3]; /* of the tip, in the tracker's frame */
			double quaternion[4];  /* w first, unit */
		} pose;
		struct {
			double mean_N[3]; /* since the item before */
			double sd_N;	  /* of these samples; NAN: of less than two */
			int samples;
		} force;
		const struct incise_camera_frame *frame;
		double depth_mm; /* of the tip below the surface */
		const struct incise_state_now *loop;
		struct {
			enum serve_state state;
			const char *name; /* "running", … */
			const char *text; /* a line for people */
			bool changed;	  /* from the status before */
		} status;
	};
};

/* --- sinks ----------------------------------------------------------------------------- */

/* The items that will come, for a sink that announces them. */
struct serve_info {
	const char *name; /* "loop neck", "rig sim:", "recording a.rec" */
	double rate_hz;	  /* poses and forces at most */
	bool kinds[SERVE_KINDS];
	bool commanded; /* forces are a loop's commands, in the tracker's frame */
	bool tools;	/* its tool can be set */
};

struct serve_sink {
	const struct serve_sink_ops *ops;
};

struct serve_sink_ops {
	/* Send an item to all clients that want it; never waits. */
	void (*send)(struct serve_sink *sink, const struct serve_item *item);
	/* The end of a round of items: kept items leave together. NULL: nothing. */
	void (*flush)(struct serve_sink *sink);
	/*
	 * A descriptor that polls as readable when the sink has work, and the work; NULL: no
	 * work. Bounded by itself, whatever clients do.
	 */
	int (*fd)(const struct serve_sink *sink);
	void (*work)(struct serve_sink *sink);
	/* Ten times a second: timeouts. NULL: no timeouts. */
	void (*tick)(struct serve_sink *sink, int64_t now_ns);
	/* Whether all sent items have left; for the end. NULL: always. */
	bool (*is_empty)(const struct serve_sink *sink);
	/* A few words for the status line: "3 clients, 2 lost". Returns its length. */
	int (*summary)(const struct serve_sink *sink, char *text, size_t size);
	/* The end: say goodbye to all. */
	void (*close)(struct serve_sink *sink);
	/* The report after that, an object whose key is added to the program's; and as lines. */
	json_t *(*report)(const struct serve_sink *sink);
	void (*print)(const struct serve_sink *sink);
	void (*free)(struct serve_sink *sink);
};

/* OpenIGTLink (igtl.c). */
struct serve_igtl_options {
	const char *address; /* [ADDR:]PORT */
	int version;	     /* 0: 1, and the client's version */
	double idle_s;	     /* a client that stands still for so long is closed */
};

/* Listen; fails the program if it cannot. @info lives longer. */
struct serve_sink *serve_igtl_new(const struct serve_igtl_options *options,
				  const struct serve_info *info);

/*
 * The Lab Streaming Layer, streams PREFIX-pose, -force and -events, or ROS 2, topics /PREFIX/measured_cp,
 * … (outlets.c); fails the program if there is no liblsl or Cyclone DDS. @options and @info live longer.
 */
struct serve_outlets_options {
	enum incise_outlet_protocol protocol;
	const char *prefix;
	int domain;	       /* of ROS 2 */
	const char *interface; /* of ROS 2; NULL: any */
};

/* The argument of --ros2 into a struct serve_outlets_options, behind the environment of ROS 2. */
void serve_ros2_parse(void *options, char *text);

struct serve_sink *serve_outlets_new(const struct serve_outlets_options *options,
				     const struct serve_info *info);

struct serve_source;

/* Pages of browsers, and the viewer (http.c). */
struct serve_http_options {
	const char *address; /* [ADDR:]PORT; NULL: no pages */
	const char *url;     /* file for the page's address; NULL: the terminal */
	const char *view;    /* a file to show in place of the source; or NULL */
	bool control;	     /* orders are taken */
	char capture[80];    /* name of the recording that is made; "" none */
};

/* Listen; fails the program if it cannot. @options, @info and @source, which may be NULL, live longer. */
struct serve_sink *serve_http_new(const struct serve_http_options *options,
				  const struct serve_info *info,
				  struct serve_source *source);

/* --- sources --------------------------------------------------------------------------- */

struct serve_stream;

struct serve_source {
	const struct serve_source_ops *ops;
};

struct serve_source_ops {
	/*
	 * Hand on new samples, and set the time of the next call, this machine's
	 * CLOCK_MONOTONIC. Returns 0; 1: there is no more.
	 */
	int (*read)(struct serve_source *source, struct serve_stream *stream,
		    int64_t now_ns, int64_t *next_ns);
	/*
	 * An order of a page: "tool", "capture", "stop", "mark", with its text. Returns whether it
	 * failed, and in @reply why, or what was done. NULL: none is taken.
	 */
	bool (*order)(struct serve_source *source, const char *what, const char *text,
		      char *reply, size_t size);
	/* UTC of a time of the source, ns since 1970; 0: not known. */
	int64_t (*utc)(struct serve_source *source, int64_t t_ns);
	void (*free)(struct serve_source *source);
};

/* Options of the sources; each sets @info. They fail the program if they cannot be opened. */
struct serve_source_options {
	const char *operand; /* a loop, its status file, or a recording; or NULL */
	const char *rig;
	struct incise_calibration calibration;
	const char *calibration_path; /* NULL: nominal values */
	char *capture; /* of 80 bytes: name of the recording that is made, set by the rig */
	bool camera;   /* send frames */
	bool camera_needed; /* and fail without */
	double rate_hz;
	double speed; /* of a recording */
	bool endless; /* start a recording again at its end */
};

struct serve_source *serve_loop_open(const struct serve_source_options *options,
				     struct serve_info *info);
struct serve_source *serve_rig_open(const struct serve_source_options *options,
				    struct serve_info *info);
struct serve_source *serve_recording_open(const struct serve_source_options *options,
					  struct serve_info *info);

/* --- the stream between them ----------------------------------------------------------- */

/*
 * Samples of the source. A pose is of the tracked point, which @tip_mm moves to the tip; forces
 * are averaged until one is due. @lost: samples that the source has lost so far.
 */
void serve_pose(struct serve_stream *stream, int64_t t_ns, const double position_mm[3],
		const double quaternion[4], const double tip_mm[3], uint64_t lost);
void serve_force(struct serve_stream *stream, int64_t t_ns, const double force_N[3],
		 uint64_t lost);
/* The depth of the tip, and the state of a loop: for pages alone. */
void serve_depth(struct serve_stream *stream, int64_t t_ns, double depth_mm);
void serve_loop(struct serve_stream *stream, const struct incise_state_now *now);
bool serve_frame_is_due(const struct serve_stream *stream, int64_t t_ns);
void serve_frame(struct serve_stream *stream, const struct incise_camera_frame *frame,
		 uint64_t lost);
/* Losses of the source so far, when no sample comes with them. */
void serve_lost(struct serve_stream *stream, uint64_t lost);
/* Sent when it changes, and each second. */
void serve_status(struct serve_stream *stream, enum serve_state state, const char *name,
		  const char *text);
/* The source's time of a recording has jumped: from now on t_ns is played at @here_ns. */
void serve_play(struct serve_stream *stream, int64_t t_ns, int64_t here_ns, double speed);

/* Time of this machine's CLOCK_MONOTONIC as UTC, both ns, by its clock as it is set now. */
int64_t serve_utc_of(int64_t t_ns);

#endif
