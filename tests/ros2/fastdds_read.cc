// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A subscriber on Fast DDS: prints the first COUNT messages of a topic of ROS 2 as they are on the wire, in
 * hexadecimal, one a line.
 *
 *     fastdds_read DOMAIN COUNT TOPIC TYPE    for example rt/neck/events rcl_interfaces::msg::dds_::Log_
 */
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

using namespace eprosima::fastdds::dds;
typedef std::vector<uint8_t> bytes;

#if __has_include(<fastdds/config.hpp>) /* 3, of Debian 13 */
using eprosima::fastdds::dds::Duration_t;
using namespace eprosima::fastdds::rtps;
constexpr auto is_taken = RETCODE_OK;
#else
using eprosima::fastrtps::Duration_t;
using namespace eprosima::fastrtps::rtps;
const ReturnCode_t is_taken = ReturnCode_t::RETCODE_OK;
#endif

class message : public TopicDataType {
public:
	explicit message(const char *name)
	{
#if __has_include(<fastdds/config.hpp>)
		set_name(name);
		max_serialized_type_size = 10000;
#else
		setName(name);
		m_typeSize = 10000;
#endif
	}

	bool deserialize(SerializedPayload_t &payload, void *data)
	{
		static_cast<bytes *>(data)->assign(payload.data,
						   payload.data + payload.length);
		return true;
	}

#if __has_include(<fastdds/config.hpp>)
	bool serialize(const void *, SerializedPayload_t &, DataRepresentationId_t) override
	{
		return false;
	}
	uint32_t calculate_serialized_size(const void *, DataRepresentationId_t) override
	{
		return 0;
	}
	void *create_data() override { return new bytes; }
	void delete_data(void *data) override { delete static_cast<bytes *>(data); }
	bool compute_key(SerializedPayload_t &, InstanceHandle_t &, bool) override
	{
		return false;
	}
	bool compute_key(const void *, InstanceHandle_t &, bool) override { return false; }
#else
	bool serialize(void *, SerializedPayload_t *) override { return false; }
	bool deserialize(SerializedPayload_t *payload, void *data) override
	{
		return deserialize(*payload, data);
	}
	std::function<uint32_t()> getSerializedSizeProvider(void *) override
	{
		return [] { return 0; };
	}
	void *createData() override { return new bytes; }
	void deleteData(void *data) override { delete static_cast<bytes *>(data); }
	bool getKey(void *, InstanceHandle_t *, bool) override { return false; }
#endif
};

int main(int argc, char **argv)
{
	if (argc != 5)
		return 2;
	DomainParticipant *participant =
		DomainParticipantFactory::get_instance()->create_participant(
			static_cast<uint32_t>(atoi(argv[1])), PARTICIPANT_QOS_DEFAULT);
	TypeSupport type(new message(argv[4]));

	type.register_type(participant);
	Topic *topic = participant->create_topic(argv[3], argv[4], TOPIC_QOS_DEFAULT);
	Subscriber *subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
	DataReaderQos qos = DATAREADER_QOS_DEFAULT;

	qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
	DataReader *reader = subscriber->create_datareader(topic, qos);

	for (int left = atoi(argv[2]); left;) {
		bytes data;
		SampleInfo info;

		if (!reader->wait_for_unread_message(Duration_t(300, 0)))
			return 1;
		while (left && reader->take_next_sample(&data, &info) == is_taken) {
			if (!info.valid_data)
				continue;
			for (uint8_t byte : data)
				printf("%02x", byte);
			putchar('\n');
			left--;
		}
	}
	participant->delete_contained_entities();
	DomainParticipantFactory::get_instance()->delete_participant(participant);
	return 0;
}
