// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A haptic device of moteus drives, "moteus:can0:1,2,3". Each motor moves the handle along a line:
 *
 *   position  = Σ turns[i] × mm_turn[i] × dual[i]
 *   torque[i] = dual[i] · force × mm_turn[i] / 2π
 *
 * A cycle is a push, which asks for answers, and the read that makes a sample of them. The first push,
 * and one after a pause in which the watchdogs may have run out, stop the motors, as only that ends
 * their time-out; torques follow when all are in mode 10 again. A fault, a jump of a position and a
 * motor that does not answer end all torques for good.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/vector.h"
#include "../../rig/axes.h"
#include "../../rig/backends.h"
#include "../../rig/haptic_backend.h"
#include "moteus.h"

#define MOTORS INCISE_HAPTIC_MOTORS_MAX
#define RATE_HZ 1000
#define WATCHDOG_MS 50
#define WATCHDOG_NS (WATCHDOG_MS * INT64_C(1000000))
/* All of it is waited for: two answers are an error. */
#define ANSWER_NS INT64_C(20000000)
#define SCAN_NS INT64_C(1000000)    /* between the questions of a search */
#define TEST_ROUNDS 25		    /* of an answer each; a drive needs time to start */
#define SILENT_NS INT64_C(10000000) /* without an answer the device fails */
#define LATE_CYCLES 2		    /* without an answer there is no force */
#define FORCE_LATENCY_NS 300000	    /* of a frame, and of the drive's own loop */
#define JUMP_TURNS 0.25		    /* beyond the way by the velocities of two answers */
#define TURNS_MOST 1e6
/* Directions 30 degrees apart: nearer ones push against each other with twice the force. */
#define DUAL_MOST (2 + 1e-9)
/* No node of CANopen: all answers go to id 0, so one program has a bus. */
#define LOCK 128
#define INTERFACE 40

struct motor {
	int id;
	double dual[3], mm_turn, most_N_m;
	struct moteus_reply last;
	int64_t answered_ns; /* time of the last answer; 0: none */
	int64_t asked_ns;    /* time of the oldest question without one; 0: none */
	int answers;	     /* since the last question */
};

struct moteus {
	struct incise_haptic haptic;
	struct can_bus *bus;
	struct motor motor[MOTORS];
	int n;
	int64_t answer_ns; /* from a measurement to its arrival, as it was at the start */
	int64_t pushed_ns; /* time of the last push */
	uint64_t cycles, sampled; /* of pushes */
	bool running;		  /* all motors were in mode 10 since the last stop */
	uint32_t flags;		  /* why there is no torque any more */
};

static int64_t now_ns(const struct moteus *m)
{
	return m->bus->ops->now(m->bus);
}

static void send_all(struct moteus *m, void (*pack)(struct canfd_frame *frame, int id));

/* Stop all motors for good; with @code 0 positions go on. The first cause remains. */
static INCISE_PRINTF(4, 5) void end_torques(struct moteus *m, int code, unsigned int flag,
					    const char *format, ...)
{
	va_list args;

	if (m->haptic.error || (m->flags && !code))
		return;
	m->haptic.error = code;
	m->flags |= flag | INCISE_HAPTIC_NOT_READY;
	m->running = false;
	if (!*m->haptic.cause) {
		va_start(args, format);
		vsnprintf(m->haptic.cause, sizeof(m->haptic.cause), format, args);
		va_end(args);
	}
	send_all(m, moteus_pack_stop);
}

static void end_bus(struct moteus *m, int rc)
{
	end_torques(m, rc == -EIO ? rc : -ENODEV, 0, "%s: %s", m->bus->name,
		    strerror(-rc));
}

/* --- questions and answers ----------------------------------------------------------- */

/* A frame that finds no place in the queue is a question without an answer. */
static void send_frame(struct moteus *m, struct motor *motor,
		       const struct canfd_frame *frame)
{
	int rc = m->bus->ops->send_fd(m->bus, frame);

	motor->answers = 0;
	if (!motor->asked_ns)
		motor->asked_ns = now_ns(m);
	if (rc && rc != -ENOBUFS)
		end_bus(m, rc);
}

static void send_all(struct moteus *m, void (*pack)(struct canfd_frame *frame, int id))
{
	struct canfd_frame frame;

	for (int i = 0; i < m->n; i++) {
		pack(&frame, m->motor[i].id);
		send_frame(m, &m->motor[i], &frame);
	}
}

static void pack_no_torque(struct canfd_frame *frame, int id)
{
	moteus_pack_torque(frame, id, 0, 0, WATCHDOG_MS * 1e-3);
}

/* A drive that lost its count of turns; by its velocities, as far as they are numbers. */
static bool has_jumped(const struct motor *motor, const struct moteus_reply *reply,
		       int64_t t_ns)
{
	double dt_s = (double)(t_ns - motor->answered_ns) * 1e-9;
	double most = fabs(motor->last.velocity_turns_s) + fabs(reply->velocity_turns_s);
	double way = fabs(reply->position_turns - motor->last.position_turns);

	return motor->answered_ns && way > fmax(JUMP_TURNS, JUMP_TURNS + most * dt_s);
}

static void judge_answer(struct moteus *m, const struct motor *motor,
			 const struct moteus_reply *reply, int64_t t_ns)
{
	int id = motor->id;

	if (reply->refused >= 0)
		end_torques(m, -EPROTO, 0,
			    "motor %d refuses register 0x%03x; update its firmware", id,
			    (unsigned int)reply->refused);
	else if (reply->mode == MOTEUS_FAULT && m->cycles)
		end_torques(m, 0, INCISE_HAPTIC_PROTECTED,
			    "motor %d: fault %d, %s (%g C, %g V); remove its cause and "
			    "start again",
			    id, reply->fault, moteus_fault_text(reply->fault),
			    reply->temperature_C, reply->voltage_V);
	else if (!(fabs(reply->position_turns) < TURNS_MOST))
		end_torques(m, 0, INCISE_HAPTIC_PROTECTED,
			    "motor %d gives no position; check its encoder", id);
	else if (has_jumped(motor, reply, t_ns))
		end_torques(m, 0, INCISE_HAPTIC_CHANGED,
			    "motor %d: its position jumped from %g to %g turns; check "
			    "its encoder and supply, and align the device again",
			    id, motor->last.position_turns, reply->position_turns);
	else if (m->running && reply->mode != MOTEUS_POSITION)
		end_torques(m, 0, INCISE_HAPTIC_CHANGED,
			    "motor %d has restarted, or another program stopped it (mode "
			    "%d); start again",
			    id, reply->mode);
}

/* Without a whole answer a motor is silent. */
static void take_frame(struct moteus *m, const struct canfd_frame *frame, int64_t t_ns)
{
	struct moteus_reply reply;
	int id = moteus_parse(frame, &reply);

	for (int i = 0; i < m->n; i++) {
		struct motor *motor = &m->motor[i];

		if (motor->id != id)
			continue;
		judge_answer(m, motor, &reply, t_ns);
		/* Drives measure between the question and the answer. */
		if (!m->cycles)
			m->answer_ns = (t_ns - motor->asked_ns) / 2;
		motor->asked_ns = 0;
		motor->answers++;
		motor->answered_ns = t_ns;
		if (fabs(reply.position_turns) < TURNS_MOST)
			motor->last = reply;
	}
}

static void drain_bus(struct moteus *m)
{
	struct canfd_frame frame;
	int64_t t_ns;
	int rc;

	while ((rc = m->bus->ops->receive_fd(m->bus, &frame, &t_ns)) > 0)
		take_frame(m, &frame, t_ns);
	if (rc < 0)
		end_bus(m, rc);
}

/* A motor that owes an answer for longer. */
static const struct motor *find_silent(const struct moteus *m, int64_t ns)
{
	for (int i = 0; i < m->n; i++)
		if (m->motor[i].asked_ns && now_ns(m) - m->motor[i].asked_ns > ns)
			return &m->motor[i];
	return NULL;
}

static bool are_all(const struct moteus *m, enum moteus_mode mode)
{
	for (int i = 0; i < m->n; i++)
		if (m->motor[i].last.mode != (int)mode)
			return false;
	return true;
}

/* --- samples ------------------------------------------------------------------------- */

static void make_sample(const struct moteus *m, struct incise_haptic_sample *sample)
{
	*sample = (struct incise_haptic_sample){
		.t_ns = INT64_MAX,
		.seq = m->cycles - 1,
		.quaternion = {1},
		.flags = m->flags | (m->running ? 0U : INCISE_HAPTIC_NOT_READY),
	};
	for (int i = 0; i < m->n; i++) {
		const struct motor *motor = &m->motor[i];
		const struct moteus_reply *last = &motor->last;

		v3_add(sample->position_mm, sample->position_mm,
		       last->position_turns * motor->mm_turn, motor->dual);
		v3_add(sample->velocity_mm_s, sample->velocity_mm_s,
		       last->velocity_turns_s * motor->mm_turn, motor->dual);
		if (motor->answered_ns - m->answer_ns < sample->t_ns)
			sample->t_ns = motor->answered_ns - m->answer_ns;
		/* The drive limits the torque because of its temperature. */
		if (last->fault == 100 || last->fault == 101)
			sample->flags |= INCISE_HAPTIC_PROTECTED;
	}
}

static int read_moteus(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		       int n)
{
	struct moteus *m = (struct moteus *)haptic;
	const struct motor *silent;

	drain_bus(m);
	silent = find_silent(m, SILENT_NS);
	if (silent)
		end_torques(m, -EIO, 0,
			    "motor %d does not answer; check its supply and the cable",
			    silent->id);
	if (haptic->error)
		return haptic->error;
	for (int i = 0; i < m->n; i++)
		if (!m->motor[i].answers)
			return 0;
	if (n < 1 || m->sampled == m->cycles)
		return 0;
	m->running |= !m->flags && are_all(m, MOTEUS_POSITION);
	make_sample(m, samples);
	haptic->lost += m->cycles - m->sampled - 1;
	m->sampled = m->cycles;
	return 1;
}

/* --- force --------------------------------------------------------------------------- */

/* Where a motor cannot, all push less: the direction of the force remains. */
static void send_force(struct moteus *m, const double force_N[3])
{
	double torque_N_m[MOTORS], scale = 1;
	struct canfd_frame frame;

	for (int i = 0; i < m->n; i++) {
		const struct motor *motor = &m->motor[i];

		torque_N_m[i] =
			v3_dot(motor->dual, force_N) * motor->mm_turn / (2 * M_PI) * 1e-3;
		scale = fmin(scale, motor->most_N_m / fabs(torque_N_m[i]));
	}
	for (int i = 0; i < m->n; i++) {
		moteus_pack_torque(&frame, m->motor[i].id, scale * torque_N_m[i],
				   m->motor[i].most_N_m, WATCHDOG_MS * 1e-3);
		send_frame(m, &m->motor[i], &frame);
	}
}

/* The handle may be anywhere by now: no jump. */
static void restart_motors(struct moteus *m)
{
	m->running = false;
	for (int i = 0; i < m->n; i++)
		m->motor[i].answered_ns = 0;
	send_all(m, moteus_pack_stop);
}

static int push_moteus(struct incise_haptic *haptic, const double force_N[3],
		       const double torque_N_mm[3])
{
	struct moteus *m = (struct moteus *)haptic;
	int64_t now = now_ns(m), pause_ns = now - m->pushed_ns;

	(void)torque_N_mm;
	m->pushed_ns = now;
	m->cycles++;
	/* Again, as a stop may have found no place in the queue; it asks for an answer, too. */
	if (m->flags) {
		send_all(m, moteus_pack_stop);
		return haptic->error;
	}
	if (m->cycles == 1 || pause_ns > WATCHDOG_NS / 2)
		restart_motors(m);
	if (m->running &&
	    !find_silent(m, (int64_t)(LATE_CYCLES * 1e9 / m->haptic.info.rate_hz)))
		send_force(m, force_N);
	else
		send_all(m, pack_no_torque);
	return haptic->error;
}

/* --- open ---------------------------------------------------------------------------- */

static int take_words(struct moteus *m, const char *text, char interface[INTERFACE],
		      const char *where, struct incise_error *err)
{
	int id[MOTORS], end = 0;
	bool ok;

	m->n = sscanf(text, "%39[^:]:%3d%n,%3d%n,%3d%n", interface, &id[0], &end, &id[1],
		      &end, &id[2], &end) -
	       1;
	ok = m->n >= 1 && !text[end];
	for (int i = 0; ok && i < m->n; i++) {
		ok = id[i] >= 1 && id[i] <= MOTEUS_ID_MAX;
		for (int k = 0; k < i; k++)
			ok &= id[k] != id[i];
		m->motor[i].id = id[i];
	}
	return ok ? 0
		  : incise_error_set(
			    err, EINVAL,
			    "%s: expected moteus:INTERFACE:ID[,ID[,ID]], such as "
			    "moteus:can0:1,2,3, with different ids from 1 to %d",
			    where, MOTEUS_ID_MAX);
}

static int take_lines(struct moteus *m, const struct incise_haptic_setup *setup,
		      const char *where, struct incise_error *err)
{
	double direction[MOTORS][3], dual[MOTORS][3];
	bool ok = true;

	/* Numbers of the three keys fit each other. */
	if (setup->n_motors != m->n)
		return incise_error_set(
			err, EINVAL,
			"%s: haptic_setup: expected motor_direction, motor_mm_turn and "
			"motor_torque_N_mm of %d motors, not of %d",
			where, m->n, setup->n_motors);
	for (int i = 0; i < m->n; i++)
		ok &= v3_unit(direction[i], setup->motor_direction + 3 * i, 1e-6);
	if (ok)
		incise_axes_dual(m->n, direction, dual);
	for (int i = 0; i < m->n && ok; i++) {
		ok = v3_length(dual[i]) <= DUAL_MOST;
		v3_copy(m->motor[i].dual, dual[i]);
		m->motor[i].mm_turn = setup->motor_mm_turn[i];
		m->motor[i].most_N_m = setup->motor_torque_N_mm[i] * 1e-3;
	}
	return ok ? 0
		  : incise_error_set(err, EINVAL,
				     "%s: haptic_setup.motor_direction: expected "
				     "directions 30 degrees or more from each other, and "
				     "from the plane of the other two",
				     where);
}

/* Ask all motors, and wait for what they answer. */
static int ask_all(struct moteus *m, void (*pack)(struct canfd_frame *frame, int id),
		   const char *where, struct incise_error *err)
{
	int64_t until_ns = now_ns(m) + ANSWER_NS;

	send_all(m, pack);
	while (!m->haptic.error && now_ns(m) < until_ns) {
		m->bus->ops->wait(m->bus, until_ns);
		drain_bus(m);
	}
	if (m->flags)
		return incise_error_set(err, m->haptic.error ? -m->haptic.error : EPROTO,
					"%s: %s", where, m->haptic.cause);
	for (int i = 0; i < m->n; i++)
		if (m->motor[i].answers != 1)
			return incise_error_set(
				err, m->motor[i].answers ? EPROTO : ETIMEDOUT,
				m->motor[i].answers
					? "%s: two motors on %s have the id %d; give each "
					  "its own"
					: "%s: %s: no answer of motor %d; check its "
					  "supply, id and cable, and the bit rates: "
					  "1000000 and 5000000",
				where, m->bus->name, m->motor[i].id);
	return 0;
}

/* Each drive must stop by itself, after a command of no torque that nobody repeats. */
static int test_watchdogs(struct moteus *m, const char *where, struct incise_error *err)
{
	int rc = ask_all(m, moteus_pack_stop, where, err);

	if (!rc)
		rc = ask_all(m, pack_no_torque, where, err);
	for (int i = 0; i < TEST_ROUNDS && !rc && !are_all(m, MOTEUS_TIMEOUT); i++)
		rc = ask_all(m, moteus_pack_query, where, err);
	for (int i = 0; i < m->n && !rc; i++)
		if (m->motor[i].last.mode != MOTEUS_TIMEOUT)
			rc = incise_error_set(
				err, EPROTO,
				"%s: motor %d does not start, and stop by its watchdog %d "
				"ms later: mode %d, %s",
				where, m->motor[i].id, WATCHDOG_MS, m->motor[i].last.mode,
				moteus_fault_text(m->motor[i].last.fault));
	return rc ? rc : ask_all(m, moteus_pack_stop, where, err);
}

/* --- the device ---------------------------------------------------------------------- */

static void fill_info(struct moteus *m)
{
	struct incise_haptic_info *info = &m->haptic.info;

	snprintf(info->name, sizeof(info->name), "%d moteus on %s", m->n, m->bus->name);
	info->peak_N = INFINITY;
	for (int i = 0; i < m->n; i++)
		info->peak_N = fmin(info->peak_N, m->motor[i].most_N_m * 1e3 * 2 * M_PI /
							  m->motor[i].mm_turn /
							  v3_length(m->motor[i].dual));
	/* A read takes the answers to the push of the cycle before. */
	info->latency_ns = (int64_t)(1e9 / info->rate_hz);
	info->force_latency_ns = FORCE_LATENCY_NS;
	info->deadman_s = WATCHDOG_MS * 1e-3;
	info->features = INCISE_HAPTIC_PAGE_VELOCITY;
	snprintf(info->note, sizeof(info->note),
		 "without commands for %d ms its motors follow servo.timeout_mode: 12, "
		 "the default, damps; 0 lets go",
		 WATCHDOG_MS);
}

static void close_moteus(struct incise_haptic *haptic)
{
	struct moteus *m = (struct moteus *)haptic;

	if (m->bus) {
		send_all(m, moteus_pack_stop);
		m->bus->ops->close(m->bus);
	}
	free(m);
}

static const struct incise_haptic_ops moteus_ops = {
	.read = read_moteus,
	.push = push_moteus,
	.close = close_moteus,
};

void *moteus_open_on(const struct can_transport *transport,
		     const struct incise_backend_request *request,
		     struct incise_error *err)
{
	const char *where = request->where;
	char interface[INTERFACE];
	const struct can_bus_request bus = {
		.where = where, .device = interface, .node = LOCK, .fd = true};
	struct moteus *m = incise_device_new(sizeof(*m), where, err);
	int rc;

	if (!m)
		return NULL;
	m->haptic.ops = &moteus_ops;
	m->haptic.info.rate_hz =
		request->haptic->rate_hz > 0 ? request->haptic->rate_hz : RATE_HZ;
	rc = take_words(m, request->arguments, interface, where, err);
	if (!rc)
		rc = take_lines(m, request->haptic, where, err);
	if (!rc)
		rc = transport->open(&m->bus, &bus, err);
	if (!rc)
		rc = test_watchdogs(m, where, err);
	if (!rc)
		fill_info(m);
	return incise_haptic_opened(&m->haptic, rc);
}

static void *open_moteus(const struct incise_backend_request *request,
			 struct incise_error *err)
{
	return moteus_open_on(&can_transport_socketcan, request, err);
}

/* --- search -------------------------------------------------------------------------- */

static void receive_answers(struct can_bus *bus, struct motor *drives, int64_t ns)
{
	int64_t until_ns = bus->ops->now(bus) + ns, t_ns;
	struct moteus_reply reply;
	struct canfd_frame frame;
	int id;

	while (bus->ops->now(bus) < until_ns && !bus->ops->wait(bus, until_ns))
		while (bus->ops->receive_fd(bus, &frame, &t_ns) > 0)
			if ((id = moteus_parse(&frame, &reply))) {
				drives[id].answers++;
				drives[id].last = reply;
			}
}

static int report_drive(const char *interface, int id, const struct motor *drive,
			incise_scan_found *found, void *context)
{
	const struct moteus_reply *last = &drive->last;
	struct incise_scan_device device = {.usable = drive->answers == 1 &&
						      last->refused < 0};

	snprintf(device.device, sizeof(device.device), "moteus:%s:%d", interface, id);
	if (device.usable)
		snprintf(device.what, sizeof(device.what),
			 "moteus drive, mode %d, %s, %g V, %g C", last->mode,
			 moteus_fault_text(last->fault), last->voltage_V,
			 last->temperature_C);
	else
		snprintf(device.what, sizeof(device.what), "moteus drive: %s",
			 drive->answers > 1 ? "another one has this id; give each its own"
					    : "refuses a query; update its firmware");
	return found(context, &device);
}

int moteus_scan_on(const struct can_transport *transport, const char *interface,
		   incise_scan_found *found, void *context, struct incise_error *err)
{
	char where[INTERFACE + 8];
	const struct can_bus_request request = {
		.where = where, .device = interface, .node = LOCK, .fd = true};
	struct motor drives[MOTEUS_ID_MAX + 1] = {0};
	struct canfd_frame frame;
	struct can_bus *bus;
	int rc, sent = 0;

	snprintf(where, sizeof(where), "moteus:%.39s", interface);
	rc = transport->open(&bus, &request, err);
	if (rc)
		return rc;
	for (int id = 1; id <= MOTEUS_ID_MAX && !sent; id++) {
		moteus_pack_query(&frame, id);
		sent = bus->ops->send_fd(bus, &frame);
		receive_answers(bus, drives, id < MOTEUS_ID_MAX ? SCAN_NS : ANSWER_NS);
	}
	bus->ops->close(bus);
	for (int id = 1; id <= MOTEUS_ID_MAX && !rc; id++)
		if (drives[id].answers)
			rc = report_drive(interface, id, &drives[id], found, context);
	return rc;
}

/* Only on a named bus: others may use one, and the search transmits. */
static int scan_moteus(const char *arguments, incise_scan_found *found, void *context,
		       struct incise_error *err)
{
	char interface[INTERFACE];

	snprintf(interface, sizeof(interface), "%.*s", (int)strcspn(arguments, ":"),
		 arguments);
	return *interface ? moteus_scan_on(&can_transport_socketcan, interface, found,
					   context, err)
			  : incise_error_set(err, EINVAL,
					     "moteus: expected an interface, for example "
					     "moteus:can0; correct it");
}

INCISE_BACKEND(incise_haptic_moteus, "haptic", "moteus", .open = open_moteus,
	       .scan = scan_moteus);
