// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Outlets as topics of ROS 2, by Cyclone DDS; see incise/outlet.h. Not run against ROS 2 itself: Cyclone
 * DDS of Python and Fast DDS read them in tests.
 *
 *     topic   neck/measured_cp                    on the wire   rt/neck/measured_cp
 *     type    geometry_msgs/msg/PoseStamped                     geometry_msgs::msg::dds_::PoseStamped_
 *
 * Nested structures have no bytes of their own in CDR, so each message is described flat, and by its
 * name alone, as ROS 2 does up to Humble.
 */
#include <dds/dds.h>
#include <dds/ddsrt/log.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outlet.h>
#include "../../base/ros2.h"

/* Depth of the history, as ROS 2 has it by default. */
#define DEPTH 10

/* PoseStamped and WrenchStamped: a pose has 7 numbers, a wrench 6. */
struct stamped {
	struct ros2_time stamp;
	const char *frame_id;
	double values[7];
};

struct log {
	struct ros2_time stamp;
	uint8_t level;
	const char *name, *msg, *file, *function;
	uint32_t line;
};

#define FIELD(type, member, kind) DDS_OP_ADR | (kind), offsetof(struct type, member)
#define STAMP(type)                                                \
	FIELD(type, stamp.sec, DDS_OP_TYPE_4BY | DDS_OP_FLAG_SGN), \
		FIELD(type, stamp.nanosec, DDS_OP_TYPE_4BY)
#define STAMPED(n)                                                            \
	STAMP(stamped), FIELD(stamped, frame_id, DDS_OP_TYPE_STR),            \
		FIELD(stamped, values,                                        \
		      DDS_OP_TYPE_ARR | DDS_OP_SUBTYPE_8BY | DDS_OP_FLAG_FP), \
		n, DDS_OP_RTS

static const uint32_t pose_fields[] = {STAMPED(7)};
static const uint32_t wrench_fields[] = {STAMPED(6)};
static const uint32_t log_fields[] = {
	STAMP(log),
	FIELD(log, level, DDS_OP_TYPE_1BY),
	FIELD(log, name, DDS_OP_TYPE_STR),
	FIELD(log, msg, DDS_OP_TYPE_STR),
	FIELD(log, file, DDS_OP_TYPE_STR),
	FIELD(log, function, DDS_OP_TYPE_STR),
	FIELD(log, line, DDS_OP_TYPE_4BY),
	DDS_OP_RTS,
};

static void set_pose(struct stamped *message, const double *values)
{
	ros2_pose(message->values, values, values + 3);
}

static void set_wrench(struct stamped *message, const double *values)
{
	memcpy(message->values, values, 3 * sizeof(*values));
}

/* The hash of a type is that of its definition (REP 2016): nodes read it from Iron on. */
static const struct type {
	const char *name, *hash;
	uint32_t size, n;
	const uint32_t *fields;
	void (*set)(struct stamped *message, const double *values); /* NULL: text */
} types[] = {
	{ROS2_POSE, "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
	 sizeof(struct stamped), 5, pose_fields, set_pose},
	{ROS2_WRENCH, "8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77",
	 sizeof(struct stamped), 5, wrench_fields, set_wrench},
	{ROS2_LOG, "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
	 sizeof(struct log), 9, log_fields, NULL},
};

struct incise_outlet {
	const struct type *type;
	const char *frame;
	dds_entity_t topic, writer;
};

/* The part of this process in a domain: of all outlets. */
static struct {
	dds_entity_t domain; /* 0: Cyclone DDS made it by itself */
	dds_entity_t participant;
	int outlets;
} ros2;

/* The last line of Cyclone DDS; its own threads have theirs. */
static _Thread_local char said[120];

static void keep_line(void *unused, const dds_log_data_t *data)
{
	(void)unused;
	snprintf(said, sizeof(said), "%.*s", (int)strcspn(data->message, "\n"),
		 data->message);
}

/* A domain on one interface. lo has no multicast: Cyclone DDS looks for others at each port in turn. */
static dds_entity_t make_domain(uint32_t number, const char *interface)
{
	static const char alone[] =
		"<Discovery><ParticipantIndex>auto</ParticipantIndex>"
		"<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
		"<Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery>";
	bool lo = !strcmp(interface, "lo");
	char config[600];

	if (strlen(interface) > 60 || strpbrk(interface, "<&\""))
		return DDS_RETCODE_BAD_PARAMETER;
	snprintf(
		config, sizeof(config),
		"<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"%.60s\"/>"
		"</Interfaces><AllowMulticast>%s</AllowMulticast></General>%s</Domain></CycloneDDS>",
		interface, lo ? "false" : "default", lo ? alone : "");
	return dds_create_domain(number, config);
}

static int join_domain(const struct incise_outlet_setup *setup, struct incise_error *err)
{
	uint32_t number = (uint32_t)setup->domain;

	if (ros2.outlets)
		return 0;
	dds_set_log_sink(keep_line, NULL);
	ros2.domain = setup->interface ? make_domain(number, setup->interface) : 0;
	ros2.participant = ros2.domain < 0 ? ros2.domain
					   : dds_create_participant(number, NULL, NULL);
	if (ros2.participant >= 0)
		return 0;
	if (ros2.domain > 0)
		dds_delete(ros2.domain);
	return incise_error_set(
		err, EIO,
		"ROS 2 domain %d: Cyclone DDS cannot join it (%s%s%s); see the network "
		"interface and CYCLONEDDS_URI",
		setup->domain, dds_strretcode(ros2.participant), *said ? ": " : "", said);
}

static void leave_domain(void)
{
	if (ros2.outlets)
		return;
	dds_delete(ros2.participant);
	if (ros2.domain > 0)
		dds_delete(ros2.domain);
}

static dds_entity_t make_topic(const struct incise_outlet_setup *setup,
			       const struct type *type)
{
	char name[200], message[100];
	const dds_topic_descriptor_t described = {
		.m_size = type->size,
		.m_align = _Alignof(double),
		.m_typename = message,
		.m_nops = type->n,
		.m_ops = type->fields,
		.m_meta = "",
	};

	if (snprintf(name, sizeof(name), "rt/%s", setup->name) >= (int)sizeof(name))
		return DDS_RETCODE_BAD_PARAMETER;
	snprintf(message, sizeof(message), "%.*s::msg::dds_::%s_",
		 (int)strcspn(type->name, "/"), type->name, strrchr(type->name, '/') + 1);
	return dds_create_topic(ros2.participant, &described, name, NULL, NULL);
}

/*
 * Readers match whether they ask for reliable values, as they do by default, or not (sensor data). A
 * slow one loses the oldest. A text is the state until the next, and waits for readers that come later.
 */
static dds_entity_t make_writer(dds_entity_t topic, const struct type *type)
{
	static const dds_data_representation_id_t cdr = DDS_DATA_REPRESENTATION_XCDR1;
	dds_qos_t *qos = dds_create_qos();
	char hash[100];
	int n = snprintf(hash, sizeof(hash), "typehash=RIHS01_%s;", type->hash);
	dds_entity_t writer;

	dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
	dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, type->set ? DEPTH : 1);
	dds_qset_durability(qos, type->set ? DDS_DURABILITY_VOLATILE
					   : DDS_DURABILITY_TRANSIENT_LOCAL);
	dds_qset_data_representation(qos, 1, &cdr);
	dds_qset_userdata(qos, hash, (size_t)n);
	writer = dds_create_writer(ros2.participant, topic, qos, NULL);
	dds_delete_qos(qos);
	return writer;
}

static int offer_topic(struct incise_outlet *outlet,
		       const struct incise_outlet_setup *setup, struct incise_error *err)
{
	outlet->topic = make_topic(setup, outlet->type);
	outlet->writer = outlet->topic < 0 ? outlet->topic
					   : make_writer(outlet->topic, outlet->type);
	if (outlet->writer >= 0)
		return 0;
	dds_delete(outlet->topic);
	return incise_error_set(
		err, EIO,
		"ROS 2 topic /%.100s: Cyclone DDS cannot offer it (%s); see CYCLONEDDS_URI",
		setup->name, dds_strretcode(outlet->writer));
}

static const struct type *find_type(const char *name)
{
	for (size_t i = 0; i < sizeof(types) / sizeof(*types); i++)
		if (!strcmp(types[i].name, name))
			return &types[i];
	return NULL;
}

static int open_outlet(struct incise_outlet *outlet,
		       const struct incise_outlet_setup *setup, struct incise_error *err)
{
	int rc;

	if (!outlet)
		return incise_error_set(err, ENOMEM, "ROS 2 topic /%.100s: out of memory",
					setup->name);
	*outlet = (struct incise_outlet){.type = find_type(setup->type),
					 .frame = setup->frame};
	if (!outlet->type)
		return incise_error_set(err, EINVAL,
					"ROS 2 topic /%.100s: no message type '%.60s'",
					setup->name, setup->type);
	rc = join_domain(setup, err);
	if (rc)
		return rc;
	rc = offer_topic(outlet, setup, err);
	if (rc)
		leave_domain();
	else
		ros2.outlets++;
	return rc;
}

static struct incise_outlet *outlet_open(const struct incise_outlet_setup *setup,
					 struct incise_error *err)
{
	struct incise_outlet *outlet = malloc(sizeof(*outlet));
	int rc = open_outlet(outlet, setup, err);

	if (!rc)
		return outlet;
	free(outlet);
	errno = -rc;
	return NULL;
}

static void outlet_push(struct incise_outlet *outlet, const double *values, int64_t t_ns)
{
	struct stamped message = {.stamp = ros2_time((uint64_t)t_ns),
				  .frame_id = outlet->frame};

	outlet->type->set(&message, values);
	dds_write(outlet->writer, &message);
}

static void outlet_push_text(struct incise_outlet *outlet, const char *text, int64_t t_ns)
{
	const struct log message = {.stamp = ros2_time((uint64_t)t_ns),
				    .level = ROS2_LOG_INFO,
				    .name = "incise",
				    .msg = text,
				    .file = "",
				    .function = ""};

	dds_write(outlet->writer, &message);
}

static bool outlet_has_readers(struct incise_outlet *outlet)
{
	dds_publication_matched_status_t status;

	return !dds_get_publication_matched_status(outlet->writer, &status) &&
	       status.current_count > 0;
}

static void outlet_close(struct incise_outlet *outlet)
{
	if (!outlet)
		return;
	dds_delete(outlet->writer);
	dds_delete(outlet->topic);
	ros2.outlets--;
	leave_domain();
	free(outlet);
}

INCISE_API int incise_outlets_load(const char *where,
				   const struct incise_outlets **outlets,
				   struct incise_error *err);

int incise_outlets_load(const char *where, const struct incise_outlets **outlets,
			struct incise_error *err)
{
	static const struct incise_outlets functions = {
		outlet_open,	    outlet_push,  outlet_push_text,
		outlet_has_readers, outlet_close,
	};

	(void)where;
	(void)err;
	*outlets = &functions;
	return 0;
}
