/* Stands for cfe_core_api_base_msgids.h of cFE 7.0, with its default base numbers. */
#ifndef STUB_CFE_CORE_API_BASE_MSGIDS_H
#define STUB_CFE_CORE_API_BASE_MSGIDS_H
#define CFE_PLATFORM_CMD_TOPICID_TO_MIDV(topic) (0x1800 | (topic))
#define CFE_PLATFORM_TLM_TOPICID_TO_MIDV(topic) (0x0800 | (topic))
#endif
